-- The field's names.
alter table keepers rename to film_leases;
alter table opinions rename to votes;
alter table waves rename to round_work;
alter table leases rename column gather_ms to upload_linger_ms;
alter table leases rename column patience_ms to overdue_after_ms;
