-- A worker that refused to build the scene of a job, as JSON, until another machine confirms or refutes it.
alter table jobs add column scene_refusal text;
