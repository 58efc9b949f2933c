-- Machines that failed on a node, as JSON [[worker, name], ...]. A failure counts one again.
alter table pending add column failed_on text;
alter table pending drop column failed_by;
update pending set failures = failures / 10;

-- Leases under which workers died with a node, and those that lost it to others, both as JSON [[worker, name, deadline], ...].
alter table pending add column died_on text;
alter table pending add column lost_by text;
create index pending_died_on on pending (job) where died_on is not null;
alter table checks add column deaths bigint not null default 0;

-- Why a job gets no leases, and the node that a job has failed on, as JSON.
alter table jobs add column hold text;
alter table jobs add column failed_node text;
create index jobs_held on jobs (id) where hold is not null;

-- When a worker said that it ends.
alter table workers add column ended_ms bigint;
