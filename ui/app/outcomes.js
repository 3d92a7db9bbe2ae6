// The start page's pictures: what an example of each calculator gives, small and without numbers. They are kept beside the page
// and tested against the answers (`tests/golden.rs`): opening the page computes nothing.
import { html, useState, useEffect } from './lib.js';
import { scale } from './scale.js';
import { items, styles } from './draw.js';

const WIDTH = 360;
const HEIGHT = 150;
const EDGE = 6;
const GAP = 8;
/** Places come in thousandths of the picture. */
const WHOLE = [0, 1000];

let kept = null;
/** The pictures by calculator, `{ example, figure }`; none until they are there. */
export function useOutcomes() {
  const [outcomes, setOutcomes] = useState(kept ?? {});
  useEffect(() => {
    if (kept) return;
    fetch(new URL('./outcomes.json', import.meta.url))
      .then(answer => (answer.ok ? answer.json() : {}))
      .then(
        found => {
          kept = found;
          setOutcomes(found);
        },
        () => {},
      );
  }, []);
  return outcomes;
}

const none = { hidden: new Set() };

/** A picture of the start page. What it shows is said beside it. */
export function Outcome({ figure }) {
  const style = styles(figure);
  const drawn = figure.frame === 'polar' ? round(figure, style) : stacked(figure, style);
  return html`<svg class="chart small" viewBox=${`0 0 ${WIDTH} ${HEIGHT}`} aria-hidden="true">${drawn}</svg>`;
}

function stacked({ panels }, style) {
  const all = panels.reduce((sum, { height }) => sum + height, 0);
  const room = HEIGHT - 2 * EDGE - GAP * (panels.length - 1);
  const x = scale('linear', WHOLE, [EDGE, WIDTH - EDGE]);
  let top = EDGE;
  return panels.map(panel => {
    const height = (room * panel.height) / all;
    const y = scale('linear', WHOLE, [top + height, top]);
    const frame = { left: EDGE, top, width: WIDTH - 2 * EDGE, height };
    top += height + GAP;
    return items(panel, { x, y, frame, place: (h, v) => [x(h), y(v)] }, { style, ...none });
  });
}

function round({ panels: [panel] }, style) {
  const r = scale('linear', WHOLE, [HEIGHT * 0.26, HEIGHT / 2 - EDGE]);
  const place = (angle, value) => {
    const turn = (angle * Math.PI) / 180;
    return [WIDTH / 2 + r(value) * Math.cos(turn), HEIGHT / 2 - r(value) * Math.sin(turn)];
  };
  return items(panel, { place, frame: { left: 0, top: 0, width: WIDTH, height: HEIGHT } }, { style, ...none });
}
