-- Whether a job's lists of light left to chance and of chosen methods are known: a worker has built its scene. Older
-- coordinators built each scene before they stored its job.
alter table jobs add column scene_is_built bigint not null default 1;
