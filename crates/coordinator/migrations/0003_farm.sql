-- Which farm this is: blobs are marked with it, so that no other farm takes them for its own.
create table farm (
    single bigint primary key check (single = 1),
    id text not null
);
