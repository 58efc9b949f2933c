-- Whether workers that register a single digest, those of older builds, compute the same bits of a job's scene as newer
-- ones. Older builds ask all lights, and newer ones choose among many. `store/engine/backfill.rs` sets it for open jobs.
alter table jobs add column same_by_first bigint not null default 1;
