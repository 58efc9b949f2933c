-- The machine under which a node failed last: what one alone cannot do, others may. A failure counts ten, so that those in a row of one machine can
-- count less.
alter table pending add column failed_by text;
update pending set failures = 10 * failures;
