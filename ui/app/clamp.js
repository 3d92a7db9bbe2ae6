// The clamp force of a fixture as bars: what statics asks, what the moving cut asks, what is set.
import { html } from './lib.js';
import { t, number, unitOf } from './text.js';
import { resolve } from './schema.js';

const WIDTH = 1000;

const setForce = job => Object.values(job).map(part => part?.clamp_force_n).find(force => typeof force === 'number') ?? null;

/** Whether the result says anything of the clamp force. */
export const hasClamp = result => result?.clamp?.static_movable_n !== undefined;

export function ClampBars({ result, input, schema }) {
  const { clamp } = result;
  const given = setForce(input);
  const rows = [
    ['statics', t('clamp_static'), Math.max(clamp.static_movable_n, clamp.static_fixed_n)],
    ['dynamics', t('clamp_dynamic'), clamp.least_n ?? null],
    ['entry', t('clamp_entry'), clamp.least_with_entry_n ?? null],
    ...(given === null ? [] : [['given', t('clamp_set'), given]]),
  ];
  // A cut that is thrown about or diverges has no force that would hold it.
  const most = Math.max(...rows.map(row => row[2] ?? 0), 1e-9);
  const unit = unitOf(resolve(resolve(resolve(schema, schema).properties.clamp, schema).properties.least_n, schema));
  const forces = [clamp.least_n, clamp.least_with_entry_n];
  const needed = forces.every(force => typeof force === 'number') ? Math.max(...forces) : null;
  return html`
    <figure class="picture clamp" aria-label=${t('clamp_force')}>
      <figcaption><h2>${t('clamp_force')}</h2></figcaption>
      <table><tbody>${rows.map(([kind, name, force]) => html`<tr key=${kind}><th scope="row">${name}</th>
        <td class="clamp-bar"><svg viewBox=${`0 0 ${WIDTH} 14`} preserveAspectRatio="none" aria-hidden="true"><rect class=${`clamp-${kind} ${kind === 'given' && (needed === null || force < needed) ? 'short' : ''}`} x="0" y="1" width=${force === null ? 0 : Math.max((WIDTH * force) / most, 2)} height="12" />${kind === 'given' && needed !== null ? html`<path class="cursor" d=${`M${(WIDTH * needed) / most} 0V14`} vector-effect="non-scaling-stroke" />` : ''}</svg></td>
        <td class="number">${force === null ? '–' : `${number(force, 4)} ${unit}`}</td></tr>`)}</tbody></table>
      ${given !== null && needed !== null && html`<p class="quiet hint">${given >= needed ? t('clamp_holds') : t('clamp_short')}</p>`}
    </figure>`;
}
