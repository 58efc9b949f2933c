-- Whether the film of a job has the layer `caustic`.
alter table jobs add column caustic integer not null default 0;
