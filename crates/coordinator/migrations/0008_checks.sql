-- Nodes that a second worker renders too, and what each brought.

create table checks (
    id text primary key,
    job text not null references jobs (id),
    round bigint not null,
    frame bigint not null,
    tile bigint not null,
    level bigint not null,
    idx bigint not null,
    lease text references leases (id),
    unique (job, frame, tile, level, idx)
);
create index checks_by_lease on checks (lease) where lease is not null;

create table opinions (
    check_id text not null references checks (id) on delete cascade,
    worker text not null references workers (id),
    -- Hash of the node's bytes.
    digest text not null,
    primary key (check_id, worker)
);

-- Why a worker gets no work, as JSON; null for one that does.
alter table workers add column quarantine text;

-- Accepted nodes that were taken out of the film again because a worker that may have rendered them was found to be wrong.
alter table jobs add column redone_nodes bigint not null default 0;

-- Digest of the probe by the worker that was given the first nodes; only workers with the same are given more. Empty for workers that sent none.
alter table jobs add column probe_digest text;
