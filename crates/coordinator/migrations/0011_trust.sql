-- Workers of one name are one machine: whom its checks are not for, and what goes with it when it is quarantined.
create index workers_by_name on workers (name);
