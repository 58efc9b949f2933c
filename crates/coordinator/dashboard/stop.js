// What ends a job, and what has ended it, in words.

import { duration, errorValue } from './format.js';

const REASONS = {
  samples: 'all its samples',
  time: 'its time limit',
  mse: 'its target MSE',
  estimated_mse: 'its target estimated MSE',
};

/** What may end `job` before all of its samples are rendered, or nothing. */
export const limits = (job) =>
  [
    job.target_mse && `to MSE ${errorValue(job.target_mse)}`,
    job.target_estimated_mse && `to estimated MSE ${errorValue(job.target_estimated_mse)}`,
    job.time_limit_ms && `within ${duration(job.time_limit_ms)}`,
  ]
    .filter(Boolean)
    .join(' or ');

/** Samples in a pixel when all of a job is rendered. For an adaptive job, the mean, with the pilot. */
export const totalInPixel = (job) => job.total_samples / pixels(job);

/** Pixels of all planes. */
const pixels = (job) => job.width * job.height * job.frames * (job.light_plane ? 2 : 1);

/** What ended a job. */
export const reason = (job) => REASONS[job.stopped_by] ?? job.stopped_by;

/**
 * Samples in a pixel of the image. Samples beyond the round that a target ended do not count. For an adaptive job:
 * those of the noisiest tile at that round, or else the mean with the pilot.
 */
export function samplesInPixel(job) {
  const isCutOff = job.stopped_by === 'mse' || job.stopped_by === 'estimated_mse';
  return isCutOff ? job.complete_passes * job.samples_per_pass : job.samples / pixels(job);
}
