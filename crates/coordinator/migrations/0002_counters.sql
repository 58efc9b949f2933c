-- The work that accepted nodes took, as JSON: counters by name, and the builds of the workers that did it. What was
-- accepted before is not counted.

alter table nodes add column counters text not null default
    '{"height_evaluations":0,"solver_calls":0,"converged":0,"unique_solutions":0,"trials":0,"truncated":0,"rays":0,"samples":0}';
alter table nodes add column builds text not null default '[]';

-- Sum over accepted nodes.
alter table jobs add column counters text not null default
    '{"height_evaluations":0,"solver_calls":0,"converged":0,"unique_solutions":0,"trials":0,"truncated":0,"rays":0,"samples":0}';
