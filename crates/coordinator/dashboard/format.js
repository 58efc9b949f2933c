// Numbers and times as people read them.

const RATE_UNITS = [
  [1e12, 'T'],
  [1e9, 'G'],
  [1e6, 'M'],
  [1e3, 'k'],
];

/** A count with a decimal prefix: `1.24 M`. */
export function quantity(value) {
  const unit = RATE_UNITS.find(([size]) => value >= size);
  if (!unit) return value >= 10 || Number.isInteger(value) ? String(Math.round(value)) : value.toFixed(1);
  return `${significant(value / unit[0])} ${unit[1]}`;
}

/** A count, in full while that is short. */
export const count = (value) => (value < 1e5 ? String(value) : quantity(value));

/** Camera samples a second. */
export const rate = (value) => (value === undefined ? '–' : `${quantity(value)} samples/s`);

/** An error value, in the form that scripts and papers use: `3.104e-4`. */
export const errorValue = (value) => (value === undefined ? '–' : value.toExponential(3));

/** A signal-to-noise ratio. */
export const decibels = (value) => (value === undefined ? '–' : `${value.toFixed(2)} dB`);

/** A mean FLIP. */
export const difference = (value) => (value === undefined ? '–' : value.toFixed(4));

/** A fraction as whole percent; 100 only when it is complete. */
export const percent = (fraction) => `${Math.floor(fraction * 100 + 1e-9)} %`;

/** A length of time in its two largest units. */
export function duration(milliseconds) {
  const seconds = Math.max(0, milliseconds) / 1000;
  if (seconds < 10) return `${seconds.toFixed(1)} s`;
  const whole = Math.round(seconds);
  if (whole < 60) return `${whole} s`;
  if (whole < 3600) return `${Math.floor(whole / 60)} min ${whole % 60} s`;
  const minutes = Math.round(seconds / 60);
  if (minutes < 24 * 60) return `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
  const hours = Math.round(minutes / 60);
  return `${Math.floor(hours / 24)} d ${hours % 24} h`;
}

/** How long ago something was, roughly: it is not worth a new rendering every second. */
export function ago(milliseconds) {
  const seconds = milliseconds / 1000;
  if (seconds < 15) return 'just now';
  if (seconds < 60) return `${Math.floor(seconds / 15) * 15} s ago`;
  if (seconds < 3600) return `${Math.floor(seconds / 60)} min ago`;
  if (seconds < 48 * 3600) return `${Math.floor(seconds / 3600)} h ago`;
  return `${Math.floor(seconds / 86400)} days ago`;
}

/** A moment, in the reader's own way of writing it. */
export const moment = (milliseconds) =>
  new Date(milliseconds).toLocaleString(undefined, { dateStyle: 'medium', timeStyle: 'medium' });

/** A noun in the number that goes with a count. */
export const counted = (count, one, many = `${one}s`) => `${count} ${count === 1 ? one : many}`;

function significant(value) {
  if (value >= 100) return value.toFixed(0);
  return value >= 10 ? value.toFixed(1) : value.toFixed(2);
}
