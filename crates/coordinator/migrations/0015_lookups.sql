-- Few leases are active, and those alone are asked for with every claim.
drop index leases_by_state;
drop index leases_by_job;
drop index leases_due;
create index leases_running_out on leases (deadline_ms) where state = 'active';
create index leases_due on leases (job, due_ms) where state = 'active';
create index leases_ended on leases (deadline_ms) where state <> 'active';
create index leases_of_jobs on leases (job, worker) where state = 'active';

-- What is left of a wave changes with every accepted node; whether there is any, once.
drop index waves_incomplete;
create index waves_incomplete on waves (job, round) where completed_ms is null;

-- The next fencing token is one beyond the largest that a lease has; the newest lease is kept. Where older builds have dropped that, a token may come
-- again, which opens nothing: a token counts with its lease.
delete from sequences where name = 'fencing_token';
