// Colours of maps, from `palette.css`: evenly spaced in lightness, told apart by colour-blind eyes.
const read = name =>
  getComputedStyle(document.documentElement)
    .getPropertyValue(name)
    .trim()
    .split(' ')
    .map(hex => [0, 2, 4].map(at => parseInt(hex.slice(at, at + 2), 16)));
/** Lists of colours by their names: to read one makes the browser settle all styles. */
const lists = new Map();
function listed(name) {
  if (!lists.has(name)) lists.set(name, read(name));
  return lists.get(name);
}

/** Paper is white whatever the screen is. */
let isPrinting = false;
addEventListener('beforeprint', () => {
  isPrinting = true;
});
addEventListener('afterprint', () => {
  isPrinting = false;
});
const isDark = () => !isPrinting && matchMedia('(prefers-color-scheme: dark)').matches;

/** The colours of a map from low to high. */
export const colours = diverging => listed(`--map${diverging ? '-diverging' : ''}${isDark() ? '-dark' : ''}`);

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
