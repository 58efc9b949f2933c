-- How much checks have failed, and the machine under which each did last, as with pending nodes.
alter table checks add column failures bigint not null default 0;
alter table checks add column failed_by text;
