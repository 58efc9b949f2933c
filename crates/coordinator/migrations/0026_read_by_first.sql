-- Whether workers that register a single digest, those of older builds, can read a job's scene.
alter table jobs add column read_by_first bigint not null default 1;
