-- Light of small lights that a job's integrator leaves to chance, as a JSON array of texts.
alter table jobs add column left_to_chance text not null default '[]';
