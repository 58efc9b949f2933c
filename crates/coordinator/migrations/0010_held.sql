-- Which leases have been held for longest is asked with every claim for which nothing is free.
create index leases_held on leases (granted_ms, token) where state = 'active';
