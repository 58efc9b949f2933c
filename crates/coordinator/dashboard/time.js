// The passing of time, for what is told relative to now.

import { useEffect, useState } from './vendor/htm-preact.js';
import { coordinatorNow } from './api.js';

const TICK_MS = 5000;

/** The time by the coordinator's clock, in milliseconds since the Unix epoch; renewed every few seconds. */
export function useCoordinatorTime() {
  const [now, setNow] = useState(coordinatorNow);
  useEffect(() => {
    const timer = setInterval(() => setNow(coordinatorNow()), TICK_MS);
    return () => clearInterval(timer);
  }, []);
  return now;
}
