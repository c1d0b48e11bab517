/** Search in sorted lists. */

/** Place of the first one that is greater than `limit`. */
export function placeAfter<T>(sorted: readonly T[], limit: number, of: (one: T) => number): number {
  let [low, high] = [0, sorted.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (of(sorted[middle]!) <= limit) low = middle + 1;
    else high = middle;
  }
  return low;
}
