-- How different a frame and its reference look.
alter table rounds add column flip double precision;
