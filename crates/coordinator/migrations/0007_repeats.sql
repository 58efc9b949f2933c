-- How often a node was leased while another lease had it.
alter table pending add column repeats bigint not null default 0;

-- How many workers render a job is asked with every claim.
drop index leases_by_job;
create index leases_by_job on leases (job, state, worker);
