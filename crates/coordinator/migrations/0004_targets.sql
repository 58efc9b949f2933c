-- Errors at which a job ends, in squared units of radiance, and what ended it. A job that was done before ended with its last
-- round or at its time limit.

alter table jobs add column target_mse double precision;
alter table jobs add column target_estimated_mse double precision;
alter table jobs add column stopped_by text;
update jobs set stopped_by = case when complete_passes = passes then 'samples' else 'time' end where state = 'done';
