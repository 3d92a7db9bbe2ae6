// Numbers that are asked and the one that is set, as bars of one length scale: which they are, the schema of the result says
// (`x-bars` at a field beside them).
import { html } from './lib.js';
import { t, number, unitOf } from './text.js';
import { at, fieldAt, labelOf, parts, resolve } from './schema.js';

const WIDTH = 1000;
/** How the bars of what is asked look, in their order. */
const LOOKS = ['bar-first', 'bar-second', 'bar-third'];

/** The parts of a result that say so: `[{ said, value, label, schema }]`. */
function findings(root, result) {
  const whole = resolve(root, root);
  return Object.entries(result ?? {}).flatMap(([name, value]) => {
    if (!value || typeof value !== 'object' || Array.isArray(value) || !whole.properties?.[name]) return [];
    const schema = resolve(whole.properties[name], root);
    const said = Object.values(schema.properties ?? {})
      .map(part => resolve(part, root)['x-bars'])
      .find(Boolean);
    return said ? [{ said, value, schema, label: labelOf(name, schema) }] : [];
  });
}

export function Bars({ result, input, description: { output_schema: root, input_schema: inputs } }) {
  return findings(root, result).map(found => html`<${Group} key=${found.label} ...${{ ...found, input, inputs, root }} />`);
}

function Group({ said, value, schema, label, input, inputs, root }) {
  const field = name => resolve(schema.properties[name], root);
  const place = parts(said.set);
  const given = at(input, place);
  const asks = said.asks.map((names, index) => {
    const known = names.map(name => value[name]).filter(one => typeof one === 'number');
    return {
      look: LOOKS[index % LOOKS.length],
      name: labelOf(names[0], field(names[0])),
      force: known.length > 0 ? Math.max(...known) : null,
    };
  });
  const set =
    typeof given === 'number'
      ? [{ look: 'bar-given', name: fieldAt(inputs, input, place)?.label ?? t('bar_set'), force: given, isSet: true }]
      : [];
  const rows = [...asks, ...set];
  // What has no number has no bar.
  const most = Math.max(...rows.map(({ force }) => force ?? 0), 1e-9);
  const unit = unitOf(field(said.asks[0][0]));
  const needs = said.needs.map(name => value[name]);
  const needed = needs.every(one => typeof one === 'number') ? Math.max(...needs) : null;
  const isShort = needed === null || given < needed;
  return html`
    <figure class="picture clamp" aria-label=${label}>
      <figcaption><h2>${label}</h2></figcaption>
      <table><tbody>${rows.map(
        ({ look, name, force, isSet }) => html`<tr key=${look}><th scope="row">${name}</th>
        <td class="clamp-bar"><svg viewBox=${`0 0 ${WIDTH} 14`} preserveAspectRatio="none" aria-hidden="true"><rect class=${`${look} ${isSet && isShort ? 'short' : ''}`} x="0" y="1" width=${force === null ? 0 : Math.max((WIDTH * force) / most, 2)} height="12" />${isSet && needed !== null ? html`<path class="cursor" d=${`M${(WIDTH * needed) / most} 0V14`} vector-effect="non-scaling-stroke" />` : ''}</svg></td>
        <td class="number">${force === null ? '–' : `${number(force, 4)} ${unit}`}</td></tr>`,
      )}</tbody></table>
      ${typeof given === 'number' && needed !== null && html`<p class="quiet hint">${isShort ? t('bars_short') : t('bars_hold')}</p>`}
    </figure>`;
}
