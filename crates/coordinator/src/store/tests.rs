//! What every store must do, whatever lies under it: each test runs on SQLite and on a real PostgreSQL.

use std::collections::BTreeSet;

use clerestory_api::{JobId, JobState, NodeVerdict, StopReason};
use clerestory_film::NodeAddress;
use clerestory_film::counters::Counters;
use uuid::Uuid;

use crate::model::{BlobRange, DeliveredNode, Delivery, Ending, FilmLease, Grant, Merge, Work};
use crate::store::database::Store;
use crate::store::engine::error::StoreError;
use crate::store::engine::schema::SchemaError;
use crate::store::engine::source::Source;
use crate::store::engine::sql::query;
use crate::store::errors::{LeaseError, WorkerError};

mod adaptive;
mod check_holders;
mod checks;
mod claims;
mod comes_back;
mod deaths;
pub(crate) mod farm;
mod leases;
mod lookups;
mod migrations;
mod model;
mod pins;
mod refused;
mod scene_reports;
mod several;
mod silence;
mod stragglers;
mod targets;
mod workers;
mod writes;

use adaptive::{
    a_job_that_ends_before_its_pilot_leaves_none_of_it, a_pilot_that_is_not_whole_decides_nothing,
    a_pilot_that_was_not_thrown_away_goes_when_the_job_has_ended, a_target_leaves_each_tile_what_it_has_at_its_round,
    nodes_beyond_the_share_of_a_round_go_when_a_target_ends_the_job,
    passes_beyond_those_that_all_get_wait_until_they_are_shared_out,
};
use check_holders::{
    a_check_that_two_have_goes_on_without_either, checks_of_a_worker_that_is_gone_go_to_another,
    the_holder_of_a_check_keeps_it_when_another_worker_takes_it_over,
    the_second_of_two_holders_of_a_check_decides_a_dispute,
    two_workers_that_do_not_bring_a_check_keep_it_from_no_other,
    workers_of_one_name_take_checks_over_from_each_other_and_answer_once,
};
use checks::{
    a_check_ends_though_no_node_would_be_chosen_now, a_check_that_no_worker_can_do_does_not_delay_the_round,
    a_check_that_one_machine_fails_waits_for_another, a_job_stays_pinned_to_its_first_fingerprint,
    a_job_that_is_pinned_to_a_wrong_machine_alone_restarts_with_another,
    a_job_whose_passes_a_wrong_pilot_has_shared_out_begins_again,
    a_pilot_that_a_wrong_worker_has_rendered_is_rendered_again, a_worker_of_the_same_name_cannot_check,
    a_worker_whose_vote_differs_from_two_others_is_found_and_its_nodes_are_rendered_again,
    a_worker_with_another_fingerprint_cannot_check, an_answered_check_ends_a_row_of_failures,
    no_check_waits_for_a_machine_that_fails_again_and_again, points_that_were_measured_with_wrong_nodes_are_taken_back,
    the_second_upload_of_a_node_is_its_check, the_worker_that_rendered_a_node_is_not_waited_for_to_check_it,
    two_equal_votes_end_a_check, workers_of_one_name_are_one_machine,
};
use claims::{
    a_job_without_nodes_is_unpinned, a_node_that_fails_on_ten_machines_fails_the_job_in_any_case,
    a_node_that_fails_on_three_machines_fails_the_job_and_names_them,
    a_node_that_nobody_can_bring_fails_its_job_with_the_reason,
    a_worker_goes_on_with_scenes_that_it_has_unless_nobody_renders_an_older_job,
    a_worker_whose_speed_is_not_known_gets_a_pass_at_a_time,
    a_worker_with_another_fingerprint_could_try_a_job_without_nodes, an_unknown_worker_gets_no_work_but_an_error,
    concurrent_claimants_never_get_the_same_node, failures_count_where_nobody_else_could_try,
    jobs_are_served_by_priority_and_then_by_age,
    leases_that_ended_long_ago_go_and_the_next_token_is_larger_all_the_same,
    leases_that_nobody_could_renew_hold_and_fail_no_job, machines_that_fail_in_turn_fail_the_job,
    nodes_that_were_cut_before_are_cut_again_for_a_slower_worker,
    nodes_that_were_taken_over_are_not_accepted_after_the_job_was_unpinned,
    one_machine_alone_fails_no_job_that_another_could_render,
    returned_work_is_free_at_once_and_returning_twice_is_harmless, strips_of_the_light_plane_are_leased_together,
    the_speed_of_a_worker_is_that_of_its_last_work, times_of_short_nodes_add_up_and_give_a_speed,
};
use deaths::{
    a_check_that_workers_die_with_again_and_again_is_given_up, a_job_that_kills_the_only_worker_five_times_is_held,
    a_job_that_kills_the_workers_of_three_machines_is_held_until_it_is_released,
    a_lease_that_has_brought_a_node_is_no_death, a_node_with_which_one_machine_died_goes_to_another_that_is_there,
    a_worker_that_comes_back_has_not_died, a_worker_that_dies_with_a_node_that_another_took_over_counts_too,
    deaths_side_by_side_count_together_until_the_job_has_brought_a_node,
    jobs_whose_content_is_lost_are_held_until_it_is_here,
};
use farm::{Farm, TTL_MS, blob_range, delivered, merge};
use leases::{
    a_lease_is_dead_at_its_deadline_even_before_the_sweep, a_renewed_lease_lives_on, a_wrong_token_opens_nothing,
    an_expired_lease_is_claimable_again_and_its_late_result_changes_nothing,
    more_renewals_than_are_written_together_are_all_answered, renewals_that_come_together_are_answered_one_by_one,
};
use pins::{
    a_job_goes_on_when_another_method_computes_other_bits,
    a_job_of_an_older_build_goes_on_with_workers_of_the_same_first_digest,
    a_job_of_many_lights_stays_with_the_builds_that_began_it,
    a_job_that_older_workers_cannot_read_is_left_to_newer_ones,
    a_job_whose_method_has_changed_waits_and_names_the_two_ways_out,
    a_job_with_the_layer_caustic_is_left_to_workers_that_know_it, a_new_probe_case_strands_no_job,
};
use refused::a_database_of_another_program_is_refused_and_left_as_it_is;
use scene_reports::{
    a_machine_that_builds_a_refused_scene_refutes_the_refusal,
    a_refused_scene_fails_its_job_at_once_where_no_other_machine_could_try, a_report_needs_a_valid_lease,
    a_scene_that_two_machines_refuse_fails_its_job_and_counts_against_nobody,
    a_worker_that_refuses_a_scene_that_others_render_fails_its_lease_alone,
    reports_are_forgotten_when_a_job_is_unpinned, the_first_report_on_a_scene_counts_and_survives,
};
use stragglers::{
    a_node_is_not_leased_again_without_end, a_single_node_is_taken_over_by_its_passes,
    held_nodes_are_taken_over_and_the_first_result_wins,
    late_nodes_are_taken_over_beside_an_older_lease_that_may_keep_its_own,
    nodes_wait_for_others_no_longer_than_their_lease_should_take,
    overdue_nodes_of_an_urgent_job_come_before_free_work_of_others,
    overdue_nodes_of_the_next_round_are_taken_over_while_there_is_work_of_later_ones, stragglers_do_not_delay_the_end,
    stragglers_do_not_hold_up_the_end_where_workers_keep_nodes_for_long,
    what_a_worker_may_still_keep_is_not_taken_over,
};
use targets::{
    a_round_that_reaches_a_target_ends_the_job_and_what_lies_beyond_it_goes,
    a_target_that_is_not_reached_leaves_the_last_round_to_end_the_job,
    a_target_that_is_reached_after_the_end_changes_nothing,
    errors_and_targets_that_were_absent_at_first_are_stored_later, the_time_of_earlier_rounds_counts_in_later_ones,
};
use workers::{
    a_silent_worker_is_listed_for_a_day_or_until_its_machine_is_back,
    a_worker_that_ends_gives_all_back_and_leaves_the_list,
    workers_that_nothing_refers_to_are_forgotten_and_quarantined_ones_stay,
};
use writes::{
    a_failed_write_takes_nothing_else_with_it, a_lease_lasts_from_when_it_is_granted,
    a_transaction_ends_with_one_patient_write, claims_take_turns_with_other_writes,
    heartbeats_renewals_and_film_leases_are_written_before_waiting_writes,
    other_writes_are_carried_out_after_their_caller_has_disconnected, the_claim_of_a_disconnected_worker_takes_nothing,
    the_claim_of_a_worker_that_disconnects_during_another_write_takes_nothing,
    the_error_of_a_write_is_not_reported_when_its_transaction_fails,
    waiting_writes_are_carried_out_before_the_store_closes,
};

async fn a_repeated_upload_is_answered_with_duplicates(farm: Farm) {
    let job = farm.job(1).await;
    let worker = farm.worker().await;
    let grant = farm.claim(worker, 2, 0).await.unwrap();
    let first = farm.deliver(&grant, &grant.nodes[..1], 0).await.unwrap();
    assert_eq!((first.verdicts, first.outstanding), (vec![NodeVerdict::Accepted], 1));
    let second = farm.deliver(&grant, &grant.nodes, 0).await.unwrap();
    assert_eq!(second.verdicts, [NodeVerdict::Duplicate, NodeVerdict::Accepted]);
    let third = farm.deliver(&grant, &grant.nodes, 0).await.unwrap();
    assert_eq!((third.verdicts, third.outstanding), (vec![NodeVerdict::Duplicate; 2], 0));
    let record = farm.store.job(job).await.unwrap().unwrap();
    assert_eq!((record.accepted_nodes, record.samples), (2, 2 * 16 * 16 * 4));
}

async fn a_node_outside_the_lease_is_refused_and_one_under_an_accepted_ancestor_is_a_duplicate(farm: Farm) {
    let job = farm.job(2).await;
    let worker = farm.worker().await;
    let grant = farm.claim(worker, 100, 0).await.unwrap();
    let outside = NodeAddress { frame: 0, tile: 0, level: 1, index: 0 };
    let answer = farm.deliver(&grant, &[outside], 0).await.unwrap();
    assert_eq!(answer.verdicts, [NodeVerdict::Refused]);
    assert!(farm.addresses(job).await.is_empty());
    let children: Vec<NodeAddress> = outside.children().unwrap().to_vec();
    farm.deliver(&grant, &children, 0).await.unwrap();
    let counters = Counters { rays: 1 + 2, ..Counters::default() };
    farm.store.replace(job, 0, vec![merge(outside, blob_range("parent", 0))]).await.unwrap();
    assert_eq!(farm.addresses(job).await, [outside]);
    let answer = farm.deliver(&grant, &[children[1], outside], 0).await.unwrap();
    assert_eq!(answer.verdicts, [NodeVerdict::Duplicate, NodeVerdict::Duplicate]);
    assert_eq!(farm.addresses(job).await, [outside]);
    let work = Work { counters, builds: BTreeSet::from(["b".to_owned()]) };
    assert_eq!(farm.store.nodes(job, 0, 0..u32::MAX, u32::MAX).await.unwrap()[0].work, work, "counted once");
    assert_eq!(farm.store.job(job).await.unwrap().unwrap().counters, counters, "counted once");
}

async fn a_parent_replaces_two_children_or_nothing(farm: Farm) {
    let job = farm.job(2).await;
    let worker = farm.worker().await;
    let grant = farm.claim(worker, 100, 0).await.unwrap();
    let parent = NodeAddress { frame: 0, tile: 0, level: 1, index: 0 };
    let [left, _] = parent.children().unwrap();
    farm.deliver(&grant, &[left], 0).await.unwrap();
    let replaced = farm.store.replace(job, 0, vec![merge(parent, blob_range("parent", 0))]).await;
    assert!(replaced.is_err());
    assert_eq!(farm.addresses(job).await, [left]);
}

async fn a_blob_is_needed_until_the_last_of_its_nodes_has_been_replaced(farm: Farm) {
    let job = farm.job(2).await;
    let worker = farm.worker().await;
    let grant = farm.claim(worker, 100, 0).await.unwrap();
    let parents = [0, 1].map(|tile| NodeAddress { frame: 0, tile, level: 1, index: 0 });
    let children: Vec<NodeAddress> = parents.iter().flat_map(|parent| parent.children().unwrap()).collect();
    let together = |(address, offset): (&NodeAddress, u64)| DeliveredNode {
        blob_range: blob_range("together", offset),
        ..delivered(*address)
    };
    let nodes: Vec<DeliveredNode> = children.iter().zip((0..).step_by(10)).map(together).collect();
    let blob_ranges: Vec<BlobRange> = nodes.iter().map(|node| node.blob_range.clone()).collect();
    assert_eq!(farm.bring(&grant, nodes, 0).await.unwrap().verdicts, [NodeVerdict::Accepted; 4]);
    let rows = farm.store.nodes(job, 0, 0..u32::MAX, u32::MAX).await.unwrap();
    assert!(rows.iter().map(|row| &row.blob_range).eq(&blob_ranges));

    let [first, second] = parents.map(|parent| merge(parent, blob_range("merged", u64::from(parent.tile) * 10)));
    let removed = farm.store.replace(job, 0, vec![first]).await.unwrap();
    assert_eq!((removed.blob_ranges.as_slice(), removed.blobs), (&blob_ranges[..2], vec![]));
    let removed = farm.store.replace(job, 0, vec![second]).await.unwrap();
    assert_eq!((removed.blob_ranges.as_slice(), removed.blobs), (&blob_ranges[2..], vec!["together".to_owned()]));
    assert_eq!(farm.addresses(job).await, parents);
    assert_eq!(farm.store.node_blobs().await.unwrap(), BTreeSet::from(["merged".to_owned()]));
}

async fn a_cancelled_job_accepts_nothing_more_and_keeps_what_it_has(farm: Farm) {
    let job = farm.job(1).await;
    let worker = farm.worker().await;
    let grant = farm.claim(worker, 2, 0).await.unwrap();
    farm.deliver(&grant, &grant.nodes[..1], 0).await.unwrap();
    assert!(farm.store.end_job(job, Ending::Cancelled, 0).await.unwrap());
    assert!(!farm.store.end_job(job, Ending::Failed("late".to_owned()), 0).await.unwrap());
    assert!(matches!(farm.deliver(&grant, &grant.nodes[1..], 0).await, Err(LeaseError::JobNotRunning)));
    assert_eq!(farm.state(job).await, JobState::Cancelled);
    assert_eq!(farm.addresses(job).await, grant.nodes[..1]);
    assert!(farm.claim(worker, 1, 0).await.is_none());
}

async fn nothing_is_lost_when_the_store_is_reopened(farm: Farm) {
    let job = farm.job(3).await;
    let worker = farm.worker().await;
    let held = farm.claim(worker, 4, 0).await.unwrap();
    farm.deliver(&held, &held.nodes[..2], 0).await.unwrap();
    let before = farm.store.nodes(job, 0, 0..u32::MAX, u32::MAX).await.unwrap();
    let farm = farm.reopened().await;
    assert_eq!(farm.store.nodes(job, 0, 0..u32::MAX, u32::MAX).await.unwrap(), before);
    let rest = farm.deliver(&held, &held.nodes[2..], 0).await.unwrap();
    assert_eq!((rest.verdicts, rest.outstanding), (vec![NodeVerdict::Accepted; 2], 0));
    let next = farm.claim(worker, 1, 0).await.unwrap();
    assert!(next.lease.token > held.lease.token);
    assert!(!held.nodes.contains(&next.nodes[0]));
}

async fn rounds_complete_in_order_and_the_last_ends_the_job(farm: Farm) {
    let job = farm.job(3).await;
    let worker = farm.worker().await;
    let all = farm.claim(worker, 256, 0).await.unwrap();
    let (first, rest): (Vec<_>, Vec<_>) = all.nodes.iter().partition(|node| node.passes().first == 0);
    farm.deliver(&all, &rest, 100).await.unwrap();
    assert_eq!(farm.next_complete_round(job).await, None, "the first wave is missing");
    farm.deliver(&all, &first[1..], 200).await.unwrap();
    assert_eq!(farm.next_complete_round(job).await, None, "one tile is missing");
    farm.deliver(&all, &first[..1], 300).await.unwrap();
    for (round, passes) in [(0, 1), (1, 2), (2, 3)] {
        let complete = farm.next_complete_round(job).await.unwrap();
        assert_eq!((complete.round, complete.passes, complete.completed_ms), (round, passes, 300));
        let record = farm.store.job(job).await.unwrap().unwrap();
        assert_eq!(record.state, JobState::Running);
        assert!(farm.store.record_round(&record, Vec::new(), 400).await.unwrap().is_some());
        assert_eq!(farm.store.record_round(&record, Vec::new(), 400).await.unwrap(), None, "a round is recorded once");
    }
    assert_eq!(farm.state(job).await, JobState::Done);
}

async fn times_beyond_all_numbers_leave_the_farm_usable(farm: Farm) {
    let job = farm.job(2).await;
    let worker = farm.worker().await;
    let grant = farm.claim(worker, 256, 0).await.unwrap();
    for node in &grant.nodes {
        let (lease, token) = (grant.lease.id, grant.lease.token);
        let delivery =
            Delivery { lease, token, nodes: vec![delivered(*node)], core_ms: i64::MAX, now_ms: 0, alive_ms: 0 };
        farm.store.accept(delivery).await.unwrap();
    }
    for _ in 0..2 {
        assert_eq!(farm.next_complete_round(job).await.unwrap().core_ms, i64::MAX);
        let record = farm.store.job(job).await.unwrap().unwrap();
        assert_eq!(record.core_ms, i64::MAX);
        farm.store.record_round(&record, Vec::new(), 0).await.unwrap();
    }
    assert_eq!(farm.state(job).await, JobState::Done);
    assert_eq!(farm.store.workers(0, 0).await.unwrap()[0].core_ms, i64::MAX);
    let next = farm.job(1).await;
    assert_eq!(farm.claim(worker, 1, 0).await.unwrap().lease.job, next);
}

async fn a_time_limit_counts_from_the_first_lease_and_keeps_what_is_complete(farm: Farm) {
    let job = farm.job_with(100, 0, Some(500)).await;
    let worker = farm.worker().await;
    assert!(farm.store.end_jobs_out_of_time(10_000).await.unwrap().is_empty());
    let grant = farm.claim(worker, 20, 10_000).await.unwrap();
    farm.deliver(&grant, &grant.nodes[..16], 10_100).await.unwrap();
    farm.store.record_round(&farm.store.job(job).await.unwrap().unwrap(), Vec::new(), 10_200).await.unwrap();
    assert!(farm.claim(worker, 2, 10_500).await.is_none(), "no work after the limit");
    assert_eq!(farm.store.end_jobs_out_of_time(10_500).await.unwrap(), [job]);
    assert_eq!(farm.state(job).await, JobState::Done);
    assert_eq!(farm.store.job(job).await.unwrap().unwrap().stopped_by, Some(StopReason::Time));
    let kept: BTreeSet<NodeAddress> = farm.addresses(job).await.into_iter().collect();
    assert_eq!(kept, grant.nodes[..16].iter().copied().collect());
}

async fn a_time_limit_ends_no_job_before_its_first_round_and_then_nothing_else_is_rendered(farm: Farm) {
    let job = farm.job_with(100, 0, Some(500)).await;
    let worker = farm.worker().await;
    let lost = farm.claim(worker, 3, 10_000).await.unwrap();
    farm.deliver(&lost, &lost.nodes[..1], 10_100).await.unwrap();
    assert!(farm.store.end_jobs_out_of_time(20_000).await.unwrap().is_empty(), "there is no image yet");
    farm.expire(20_000).await;
    let rest = farm.claim(worker, 256, 20_000).await.unwrap();
    let tiles = farm.store.job(job).await.unwrap().unwrap().grid.len();
    assert_eq!(rest.nodes.len() as u32, tiles - 1);
    assert!(rest.nodes.iter().all(|node| node.passes().first == 0), "{:?}", rest.nodes);
    assert!(farm.claim(worker, 1, 20_000).await.is_none(), "nothing but the first round");
    farm.deliver(&rest, &rest.nodes, 20_100).await.unwrap();
    assert_eq!(farm.next_complete_round(job).await.unwrap().round, 0);
    farm.store.record_round(&farm.store.job(job).await.unwrap().unwrap(), Vec::new(), 20_200).await.unwrap();
    assert_eq!(farm.store.end_jobs_out_of_time(20_300).await.unwrap(), [job]);
    assert_eq!(farm.state(job).await, JobState::Done);
}

async fn a_farm_keeps_its_identity(farm: Farm) {
    let identity = farm.store.identity().await.unwrap();
    assert_eq!(farm.store.identity().await.unwrap(), identity);
    assert_eq!(farm.reopened().await.store.identity().await.unwrap(), identity);
}

async fn a_database_of_a_newer_build_is_refused_with_both_versions(farm: Farm) {
    let newer = farm.store.write::<i64, StoreError, _>(|connection| {
        Box::pin(async move {
            let migrations = "insert into _sqlx_migrations (version, description, success, checksum, execution_time) \
                              select 99, 'later', success, checksum, 0 from _sqlx_migrations where version = 1";
            let known = query("select max(version) as known from _sqlx_migrations").fetch_one(&mut *connection).await?;
            query(migrations).execute(connection).await?;
            known.integer("known")
        })
    });
    let own = newer.await.unwrap();
    farm.store.close().await;
    let error = Store::open(farm.source).await.unwrap_err();
    assert!(matches!(error, SchemaError::Newer { found: 99, known, .. } if known == own), "{error}");
}

async fn a_lost_connection_fails_what_was_under_way_and_nothing_after_it(farm: Farm) {
    let job = farm.job(1).await;
    // The writer's own connection is ended from outside, where there is an outside.
    let ended = query(
        "select pg_terminate_backend(pid) from pg_stat_activity where datname = current_database() \
         and pid <> pg_backend_pid()",
    );
    let has_server = ended.fetch_all(&farm.store.readers).await.is_ok();
    assert_eq!(has_server, farm.source.is_shared());
    let worker = farm.worker().await;
    assert_eq!(farm.claim(worker, 3, 0).await.unwrap().nodes.len(), 3);
    assert_eq!(farm.state(job).await, JobState::Running);
}

async fn a_film_lease_belongs_to_one_coordinator_until_its_term_ends(farm: Farm) {
    let job = farm.job(1).await;
    let [one, other] = [(); 2].map(|()| Uuid::now_v7());
    let keep = |coordinator, now_ms| farm.store.acquire_film_lease(job, coordinator, now_ms, now_ms + 100);
    assert_eq!(keep(one, 0).await.unwrap(), FilmLease::Held);
    assert_eq!(keep(other, 50).await.unwrap(), FilmLease::HeldElsewhere { until_ms: 100 });
    assert_eq!(keep(one, 60).await.unwrap(), FilmLease::Held);
    assert_eq!(keep(other, 159).await.unwrap(), FilmLease::HeldElsewhere { until_ms: 160 });
    assert_eq!(keep(other, 160).await.unwrap(), FilmLease::Held);
    assert_eq!(keep(one, 170).await.unwrap(), FilmLease::HeldElsewhere { until_ms: 260 });
    farm.store.release_film_leases(one).await.unwrap();
    assert_eq!(keep(one, 180).await.unwrap(), FilmLease::HeldElsewhere { until_ms: 260 });
    farm.store.release_film_leases(other).await.unwrap();
    assert_eq!(keep(one, 190).await.unwrap(), FilmLease::Held);
    let gone = JobId::from(Uuid::now_v7());
    assert_eq!(
        farm.store.acquire_film_lease(gone, one, 0, 100).await.unwrap(),
        FilmLease::Held,
        "a job that is gone is no obstacle"
    );
}

async fn missed_events_are_the_newest_of_the_job_that_is_asked_for(farm: Farm) {
    let (watched, other) = (farm.job(1).await, farm.job(1).await);
    for job in [other, watched] {
        farm.store.end_job(job, Ending::Cancelled, 1).await.unwrap();
    }
    let missed = async |job, id, limit| {
        let events = farm.store.missed_events(job, id, limit).await.unwrap();
        events.iter().map(|event| event.id).collect::<Vec<_>>()
    };
    assert_eq!(missed(Some(watched), 0, 10).await, [1, 4]);
    assert_eq!(missed(Some(watched), 1, 10).await, [4]);
    assert_eq!(missed(Some(other), 0, 1).await, [3]);
    assert_eq!(missed(None, 1, 2).await, [3, 4]);
    assert_eq!(missed(Some(JobId::from(Uuid::nil())), 0, 10).await, [0; 0]);
}

/// Changes a setting of a PostgreSQL database for its sessions to come, and ends all that there are.
pub(crate) async fn alter_database(address: &str, change: &str) {
    let (server, name) = address.rsplit_once('/').unwrap();
    let administrator = Source::postgres(&format!("{server}/postgres").parse().unwrap()).unwrap().readers().unwrap();
    for statement in [
        format!("alter database {name} {change}"),
        format!("select pg_terminate_backend(pid) from pg_stat_activity where datname = '{name}'"),
    ] {
        query(statement).execute(&administrator).await.unwrap();
    }
    administrator.close().await;
}

/// Only what stands where a parameter may stand is one, and each is known by its number.
async fn a_dollar_in_a_text_is_no_parameter(farm: Farm) {
    let select = || {
        query(
            "select '$1 and $2' as words, cast($2 as text) as second, cast($1 as text) as first, cast($2 as text) as \
             again",
        )
    };
    let row = select().bind("one").bind("two").fetch_one(&farm.store.readers).await.unwrap();
    let texts = ["words", "first", "second", "again"].map(|column| row.text(column).unwrap());
    assert_eq!(texts, ["$1 and $2", "one", "two", "two"]);
    let missing = select().bind("one").fetch_one(&farm.store.readers).await;
    assert!(missing.is_err(), "nothing is bound to the second: {missing:?}");
}

/// One test for each engine.
macro_rules! on_both {
    ($($name:ident)*) => {
        mod sqlite {
            $(
                #[tokio::test]
                async fn $name() {
                    super::$name(super::Farm::in_a_file().await).await;
                }
            )*
        }

        mod postgres {
            $(
                #[tokio::test]
                async fn $name() {
                    super::$name(super::Farm::in_postgres().await).await;
                }
            )*
        }
    };
}

on_both! {
    a_dollar_in_a_text_is_no_parameter
    a_database_of_another_program_is_refused_and_left_as_it_is
    a_film_lease_belongs_to_one_coordinator_until_its_term_ends
    concurrent_claimants_never_get_the_same_node
    leases_that_ended_long_ago_go_and_the_next_token_is_larger_all_the_same
    jobs_are_served_by_priority_and_then_by_age
    a_worker_goes_on_with_scenes_that_it_has_unless_nobody_renders_an_older_job
    an_expired_lease_is_claimable_again_and_its_late_result_changes_nothing
    a_lease_is_dead_at_its_deadline_even_before_the_sweep
    a_renewed_lease_lives_on
    renewals_that_come_together_are_answered_one_by_one
    more_renewals_than_are_written_together_are_all_answered
    a_wrong_token_opens_nothing
    a_repeated_upload_is_answered_with_duplicates
    a_node_outside_the_lease_is_refused_and_one_under_an_accepted_ancestor_is_a_duplicate
    a_parent_replaces_two_children_or_nothing
    a_blob_is_needed_until_the_last_of_its_nodes_has_been_replaced
    held_nodes_are_taken_over_and_the_first_result_wins
    a_node_is_not_leased_again_without_end
    a_single_node_is_taken_over_by_its_passes
    overdue_nodes_of_an_urgent_job_come_before_free_work_of_others
    overdue_nodes_of_the_next_round_are_taken_over_while_there_is_work_of_later_ones
    a_worker_whose_speed_is_not_known_gets_a_pass_at_a_time
    nodes_that_were_cut_before_are_cut_again_for_a_slower_worker
    strips_of_the_light_plane_are_leased_together
    times_of_short_nodes_add_up_and_give_a_speed
    the_speed_of_a_worker_is_that_of_its_last_work
    two_equal_votes_end_a_check
    a_worker_whose_vote_differs_from_two_others_is_found_and_its_nodes_are_rendered_again
    points_that_were_measured_with_wrong_nodes_are_taken_back
    a_check_that_no_worker_can_do_does_not_delay_the_round
    no_check_waits_for_a_machine_that_fails_again_and_again
    a_check_that_one_machine_fails_waits_for_another
    an_answered_check_ends_a_row_of_failures
    a_worker_with_another_fingerprint_cannot_check
    workers_of_one_name_are_one_machine
    a_worker_of_the_same_name_cannot_check
    a_check_ends_though_no_node_would_be_chosen_now
    a_job_that_is_pinned_to_a_wrong_machine_alone_restarts_with_another
    the_holder_of_a_check_keeps_it_when_another_worker_takes_it_over
    a_check_that_two_have_goes_on_without_either
    two_workers_that_do_not_bring_a_check_keep_it_from_no_other
    the_second_of_two_holders_of_a_check_decides_a_dispute
    workers_of_one_name_take_checks_over_from_each_other_and_answer_once
    the_worker_that_rendered_a_node_is_not_waited_for_to_check_it
    the_second_upload_of_a_node_is_its_check
    checks_of_a_worker_that_is_gone_go_to_another
    a_job_stays_pinned_to_its_first_fingerprint
    a_job_goes_on_when_another_method_computes_other_bits
    a_new_probe_case_strands_no_job
    a_job_of_many_lights_stays_with_the_builds_that_began_it
    a_job_of_an_older_build_goes_on_with_workers_of_the_same_first_digest
    a_job_that_older_workers_cannot_read_is_left_to_newer_ones
    a_job_with_the_layer_caustic_is_left_to_workers_that_know_it
    a_job_whose_method_has_changed_waits_and_names_the_two_ways_out
    stragglers_do_not_delay_the_end
    stragglers_do_not_hold_up_the_end_where_workers_keep_nodes_for_long
    what_a_worker_may_still_keep_is_not_taken_over
    late_nodes_are_taken_over_beside_an_older_lease_that_may_keep_its_own
    nodes_wait_for_others_no_longer_than_their_lease_should_take
    returned_work_is_free_at_once_and_returning_twice_is_harmless
    a_cancelled_job_accepts_nothing_more_and_keeps_what_it_has
    a_node_that_nobody_can_bring_fails_its_job_with_the_reason
    a_node_that_fails_on_three_machines_fails_the_job_and_names_them
    a_node_that_fails_on_ten_machines_fails_the_job_in_any_case
    one_machine_alone_fails_no_job_that_another_could_render
    machines_that_fail_in_turn_fail_the_job
    failures_count_where_nobody_else_could_try
    leases_that_nobody_could_renew_hold_and_fail_no_job
    a_job_that_kills_the_workers_of_three_machines_is_held_until_it_is_released
    a_job_that_kills_the_only_worker_five_times_is_held
    deaths_side_by_side_count_together_until_the_job_has_brought_a_node
    a_node_with_which_one_machine_died_goes_to_another_that_is_there
    a_worker_that_comes_back_has_not_died
    jobs_whose_content_is_lost_are_held_until_it_is_here
    a_lease_that_has_brought_a_node_is_no_death
    a_worker_that_dies_with_a_node_that_another_took_over_counts_too
    a_check_that_workers_die_with_again_and_again_is_given_up
    the_first_report_on_a_scene_counts_and_survives
    a_machine_that_builds_a_refused_scene_refutes_the_refusal
    a_refused_scene_fails_its_job_at_once_where_no_other_machine_could_try
    a_scene_that_two_machines_refuse_fails_its_job_and_counts_against_nobody
    a_worker_that_refuses_a_scene_that_others_render_fails_its_lease_alone
    reports_are_forgotten_when_a_job_is_unpinned
    a_report_needs_a_valid_lease
    a_worker_that_ends_gives_all_back_and_leaves_the_list
    a_silent_worker_is_listed_for_a_day_or_until_its_machine_is_back
    workers_that_nothing_refers_to_are_forgotten_and_quarantined_ones_stay
    nothing_is_lost_when_the_store_is_reopened
    rounds_complete_in_order_and_the_last_ends_the_job
    times_beyond_all_numbers_leave_the_farm_usable
    a_time_limit_counts_from_the_first_lease_and_keeps_what_is_complete
    a_time_limit_ends_no_job_before_its_first_round_and_then_nothing_else_is_rendered
    errors_and_targets_that_were_absent_at_first_are_stored_later
    a_round_that_reaches_a_target_ends_the_job_and_what_lies_beyond_it_goes
    a_target_that_is_not_reached_leaves_the_last_round_to_end_the_job
    a_target_that_is_reached_after_the_end_changes_nothing
    the_time_of_earlier_rounds_counts_in_later_ones
    passes_beyond_those_that_all_get_wait_until_they_are_shared_out
    a_pilot_that_is_not_whole_decides_nothing
    a_target_leaves_each_tile_what_it_has_at_its_round
    nodes_beyond_the_share_of_a_round_go_when_a_target_ends_the_job
    a_job_that_ends_before_its_pilot_leaves_none_of_it
    a_pilot_that_was_not_thrown_away_goes_when_the_job_has_ended
    a_pilot_that_a_wrong_worker_has_rendered_is_rendered_again
    a_job_whose_passes_a_wrong_pilot_has_shared_out_begins_again
    an_unknown_worker_gets_no_work_but_an_error
    a_job_without_nodes_is_unpinned
    nodes_that_were_taken_over_are_not_accepted_after_the_job_was_unpinned
    a_worker_with_another_fingerprint_could_try_a_job_without_nodes
    a_failed_write_takes_nothing_else_with_it
    the_error_of_a_write_is_not_reported_when_its_transaction_fails
    a_transaction_ends_with_one_patient_write
    claims_take_turns_with_other_writes
    heartbeats_renewals_and_film_leases_are_written_before_waiting_writes
    a_lease_lasts_from_when_it_is_granted
    other_writes_are_carried_out_after_their_caller_has_disconnected
    the_claim_of_a_disconnected_worker_takes_nothing
    the_claim_of_a_worker_that_disconnects_during_another_write_takes_nothing
    waiting_writes_are_carried_out_before_the_store_closes
    missed_events_are_the_newest_of_the_job_that_is_asked_for
    a_farm_keeps_its_identity
    a_database_of_a_newer_build_is_refused_with_both_versions
    a_lost_connection_fails_what_was_under_way_and_nothing_after_it
}
