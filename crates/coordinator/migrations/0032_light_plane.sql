-- Whether the film of a job has a light plane, whose tile comes after those of the camera plane.
alter table jobs add column light_plane integer not null default 0;
