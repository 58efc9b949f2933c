-- How long a lease may go on without an accepted node before its work is given to others, whatever else there is to do, and when that is over.
alter table leases add column patience_ms bigint not null default 60000;
alter table leases add column due_ms bigint not null default 0;
update leases set due_ms = deadline_ms;
create index leases_due on leases (state, due_ms);

-- How fast a worker renders a job, as a mean in which what it rendered last counts most.
create table recent_rates (
    worker text not null references workers (id),
    job text not null references jobs (id),
    samples double precision not null,
    -- Microseconds, summed over cores.
    core_us double precision not null,
    primary key (worker, job)
);
insert into recent_rates (worker, job, samples, core_us) select worker, job, samples, core_ms * 1000.0 from rates;
drop table rates;
alter table recent_rates rename to rates;
