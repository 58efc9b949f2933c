-- How long a worker may keep what it has rendered under a lease before it brings it.
alter table leases add column gather_ms bigint not null default 1000;
