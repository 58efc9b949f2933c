-- Several coordinators may share a database.

-- Whether a blob store has been marked as this farm's: a farm has one, and a coordinator that is given another is refused.
alter table farm add column has_blobs bigint not null default 0;

-- Which coordinator keeps the film of a job, until when.
create table keepers (
    job text primary key references jobs (id),
    coordinator text not null,
    until_ms bigint not null
);
