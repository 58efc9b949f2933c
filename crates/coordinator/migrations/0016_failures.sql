-- The machine under which a node failed last: what one alone cannot do, others may.
alter table pending add column failed_by text;
