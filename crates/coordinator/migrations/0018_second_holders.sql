-- The lease of who has taken a check over, while the first may still answer it.
alter table checks add column second_lease text references leases (id);
create index checks_by_second_lease on checks (second_lease) where second_lease is not null;
