-- One text for SQLite and PostgreSQL: text identities, bigint milliseconds and counts, times bound by the caller.

create table sequences (
    name text primary key,
    value bigint not null
);
insert into sequences (name, value) values ('fencing_token', 0), ('event', 0);

create table assets (
    hash text primary key,
    size bigint not null,
    created_ms bigint not null
);

create table jobs (
    id text primary key,
    name text not null,
    state text not null,
    failure text,
    priority bigint not null,
    scene text not null,
    scene_hash text not null,
    integrator text not null,
    missing_light text not null,
    frames bigint not null,
    width bigint not null,
    height bigint not null,
    tile_size bigint not null,
    samples_per_pass bigint not null,
    samples_per_block bigint not null,
    passes bigint not null,
    reference text references assets (hash),
    time_limit_ms bigint,
    created_ms bigint not null,
    started_ms bigint,
    finished_ms bigint,
    -- Where the next pending rows are cut from.
    cursor_round bigint not null default 0,
    cursor_frame bigint not null default 0,
    cursor_tile bigint not null default 0,
    -- Recorded rounds, and the passes at the last one.
    rounds bigint not null default 0,
    complete_passes bigint not null default 0,
    -- Sums over accepted nodes.
    accepted_nodes bigint not null default 0,
    samples bigint not null default 0,
    core_ms bigint not null default 0
);
create index jobs_by_state on jobs (state, priority, created_ms, id);

create table job_assets (
    job text not null references jobs (id),
    path text not null,
    hash text not null references assets (hash),
    primary key (job, path)
);

create table workers (
    id text primary key,
    name text not null,
    cores bigint not null,
    build text not null,
    probe_digest text,
    registered_ms bigint not null,
    seen_ms bigint not null,
    accepted_nodes bigint not null default 0,
    refused_partials bigint not null default 0,
    -- Failures since the last accepted node, and the last one's time: a failing worker is given a rest.
    failures_in_a_row bigint not null default 0,
    failed_ms bigint not null default 0,
    samples bigint not null default 0,
    core_ms bigint not null default 0
);

-- How fast a worker renders a job.
create table rates (
    worker text not null references workers (id),
    job text not null references jobs (id),
    samples bigint not null,
    core_ms bigint not null,
    primary key (worker, job)
);

create table leases (
    id text primary key,
    token bigint not null unique,
    job text not null references jobs (id),
    worker text not null references workers (id),
    state text not null,
    -- What was leased, as JSON: [[frame, tile, level, index], ...].
    nodes text not null,
    granted_ms bigint not null,
    deadline_ms bigint not null
);
create index leases_by_state on leases (state, deadline_ms);
create index leases_by_worker on leases (worker, state);
create index leases_by_job on leases (job, state);

-- One wave of work up to a round boundary; made when the cursor reaches it.
create table waves (
    job text not null references jobs (id),
    frame bigint not null,
    round bigint not null,
    end_pass bigint not null,
    -- Passes over all tiles that are not accepted yet.
    outstanding bigint not null,
    core_ms bigint not null default 0,
    completed_ms bigint,
    primary key (job, frame, round)
);

-- Work that is cut and not accepted; with a lease while a worker has it.
create table pending (
    job text not null references jobs (id),
    round bigint not null,
    frame bigint not null,
    tile bigint not null,
    level bigint not null,
    idx bigint not null,
    failures bigint not null default 0,
    lease text references leases (id),
    primary key (job, frame, tile, level, idx)
);
create index pending_free on pending (job, round, frame, tile, idx) where lease is null;
create index pending_by_lease on pending (lease) where lease is not null;

-- Accepted nodes; no two rows of a tile share a pass.
create table nodes (
    job text not null references jobs (id),
    frame bigint not null,
    tile bigint not null,
    level bigint not null,
    idx bigint not null,
    first_pass bigint not null,
    end_pass bigint not null,
    blob text not null unique,
    primary key (job, frame, tile, level, idx)
);
create index nodes_by_pass on nodes (job, frame, tile, first_pass);

create table rounds (
    job text not null references jobs (id),
    frame bigint not null,
    round bigint not null,
    passes bigint not null,
    samples_per_pixel bigint not null,
    core_ms bigint not null,
    wall_ms bigint not null,
    recorded_ms bigint not null,
    mse double precision,
    corrected_mse double precision,
    rel_mse double precision,
    psnr double precision,
    estimated_mse double precision,
    primary key (job, frame, round)
);

create table events (
    id bigint primary key,
    kind text not null,
    job text not null references jobs (id),
    frame bigint,
    round bigint,
    created_ms bigint not null
);
