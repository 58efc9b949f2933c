-- What is in imported files and not in the scene of a job, or differs, as a JSON array of texts of the worker that built it.
alter table jobs add column import_notes text not null default '[]';
-- What the submitter assumed for a file of another program, as a JSON array of texts.
alter table jobs add column assumptions text not null default '[]';
