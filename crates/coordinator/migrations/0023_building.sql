-- The scene that a worker builds, as its last heartbeat says, as JSON.
alter table workers add column building text;
create index workers_building on workers (seen_ms) where building is not null;
