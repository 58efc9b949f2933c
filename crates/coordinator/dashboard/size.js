// The size of an element on the page.

import { useLayoutEffect, useState } from './vendor/htm-preact.js';

/** The inner width of the element that `ref` holds, in CSS pixels, kept up to date; 0 before it is known. */
export function useWidth(ref) {
  const [width, setWidth] = useState(0);
  useLayoutEffect(() => {
    const observer = new ResizeObserver(([entry]) => setWidth(Math.floor(entry.contentRect.width)));
    observer.observe(ref.current);
    return () => observer.disconnect();
  }, []);
  return width;
}
