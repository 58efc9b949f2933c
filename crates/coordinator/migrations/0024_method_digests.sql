-- Digests of the probe by method, as a worker rendered it: of the first `cases` probe cases of the method. A job is
-- pinned to one of them, or to the one digest of all methods that older builds sent.
create table method_digests (
    worker text not null references workers (id) on delete cascade,
    method text not null,
    cases bigint not null,
    digest text not null,
    primary key (worker, method, cases)
);
create index method_digests_by_digest on method_digests (digest, worker);
