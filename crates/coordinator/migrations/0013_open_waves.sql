-- Whether the next round of a job is complete is asked often, and a job may have tens of thousands of waves.
create index waves_by_round on waves (job, round);
create index waves_incomplete on waves (job, round) where outstanding > 0;
