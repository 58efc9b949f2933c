-- Jobs that share out the passes of a round among the tiles by their noise.

alter table jobs add column adaptive bigint not null default 0;
-- Camera samples of all that it is to render, once that has been decided.
alter table jobs add column shared_samples bigint;

-- What each tile gets of the passes of a round, in units of 1/65536.
create table tile_shares (
    job text not null references jobs (id),
    frame bigint not null,
    tile bigint not null,
    share bigint not null,
    primary key (job, frame, tile)
);
