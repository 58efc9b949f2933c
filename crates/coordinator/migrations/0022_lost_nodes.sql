-- Nodes whose bytes are lost are rendered again, also those of jobs that are done.

-- When a job had been done that runs again because nodes of its image are lost; it is done again, as of then, when it has them.
alter table jobs add column reopened_ms bigint;

-- What decides which nodes a second worker renders too: whoever does not know it cannot tell before.
alter table farm add column check_key text;
