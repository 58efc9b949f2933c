-- Which method `auto` has chosen for which light of a job, as a JSON array of texts.
alter table jobs add column chosen_methods text not null default '[]';
