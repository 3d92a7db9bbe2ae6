// Colours of maps, evenly spaced in lightness, told apart by colour-blind eyes: the same as in the service's SVG.
const split = text => text.split(' ').map(hex => [0, 2, 4].map(at => parseInt(hex.slice(at, at + 2), 16)));
const SEQUENTIAL = split('f2e7a0 dbe29e c4dc9c add79a 99cf9e 86c7a3 72bea7 5cb6aa 4facab 47a1ac 3e96ac 368bac 2f80ab 2b76a7 2a6c9f 296297 28588f 274e88 264480 243a78');
const DIVERGING = split('0a4a80 195b92 276da4 357fb7 4991c7 67a2d0 84b3d9 a1c5e1 bdd6ea d9e7f2 f7e3d2 f3cfb3 eeba94 e9a674 e29152 d67f3c c76e30 b85d22 a94c13 9a3b00');
const DIVERGING_DARK = split('9ad4fa 85c1e9 70aed9 5c9cc8 478ab8 3778a4 31668b 2a5573 24445c 1d3446 43301f 593b23 704726 885228 a05e29 b66c31 c87d44 da8f56 eda068 ffb27a');

/** Paper is white whatever the screen is. */
let isPrinting = false;
addEventListener('beforeprint', () => { isPrinting = true; });
addEventListener('afterprint', () => { isPrinting = false; });
export const isDark = () => !isPrinting && matchMedia('(prefers-color-scheme: dark)').matches;

/** The colours of a map from low to high. */
export function colours(diverging) {
  if (diverging) return isDark() ? DIVERGING_DARK : DIVERGING;
  return isDark() ? [...SEQUENTIAL].reverse() : SEQUENTIAL;
}

/** Which colour a value has: `[index of]` by its place between the ends. */
export function colouring({ values, value, diverging }) {
  const bend = value.scale === 'logarithmic' ? v => (v > 0 ? Math.log10(v) : NaN) : v => v;
  let low = Infinity;
  let high = -Infinity;
  for (const v of values) {
    if (v === null) continue;
    const place = bend(v);
    if (place < low) low = place;
    if (place > high) high = place;
  }
  if (diverging) {
    const reach = Math.max(Math.abs(low), Math.abs(high)) || 1;
    [low, high] = [-reach, reach];
  }
  const steps = colours(diverging);
  const straight = value.scale === 'logarithmic' ? place => 10 ** place : place => place;
  const step = v => Math.min(steps.length - 1, Math.max(0, Math.floor(((bend(v) - low) / (high - low || 1)) * steps.length)));
  return { step, steps, low: straight(low), high: straight(high), isAbove: v => bend(v) > 0 };
}
