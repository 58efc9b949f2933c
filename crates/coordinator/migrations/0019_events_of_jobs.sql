-- Whoever watches one job and comes back is sent what it missed of that job.
create index events_of_jobs on events (job, id);
