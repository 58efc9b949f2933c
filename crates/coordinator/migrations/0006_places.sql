-- Nodes that are stored together lie one after the other in one blob.

create table placed_nodes (
    job text not null references jobs (id),
    frame bigint not null,
    tile bigint not null,
    level bigint not null,
    idx bigint not null,
    first_pass bigint not null,
    end_pass bigint not null,
    blob text not null,
    -- Where in the blob it begins, and its bytes; null where it is all of the blob.
    blob_offset bigint not null default 0,
    blob_length bigint,
    counters text not null,
    builds text not null,
    primary key (job, frame, tile, level, idx)
);
insert into placed_nodes (job, frame, tile, level, idx, first_pass, end_pass, blob, counters, builds)
    select job, frame, tile, level, idx, first_pass, end_pass, blob, counters, builds from nodes;
drop table nodes;
alter table placed_nodes rename to nodes;
create index nodes_by_pass on nodes (job, frame, tile, first_pass);
create index nodes_by_blob on nodes (blob);
