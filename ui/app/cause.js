// What a diagnosis found, at a glance: how likely each cause is, its size, what the data cannot tell apart, what is
// gained on data that was held back, and the measurement worth making next.
import { html, useMemo } from './lib.js';
import { t, number, unitSymbol, unitOf } from './text.js';
import { humanised, wordOf, labelOf, resolve } from './schema.js';
import { withSpread } from './digits.js';

const WIDTH = 1000;
/** So many causes are drawn. */
const MOST_BARS = 6;
/** A cause less likely than this is not drawn. */
const LEAST_SHARE = 0.005;

/** The words that the forms have for effects and fields, by their names. */
function wordsOf(schema) {
  const kinds = new Map();
  const fields = new Map();
  const walk = part => {
    if (Array.isArray(part)) part.forEach(walk);
    if (!part || typeof part !== 'object' || Array.isArray(part)) return;
    for (const [name, own] of Object.entries(part.properties || {})) {
      const field = own.$ref || own.allOf ? resolve(own, schema) : own;
      const kind = name === 'kind' && field.enum?.length === 1 ? field.enum[0] : null;
      if (kind && !kinds.has(kind)) kinds.set(kind, { text: wordOf(field, kind), properties: part.properties });
      if (!fields.has(name) && field.title) fields.set(name, field);
    }
    Object.values(part).forEach(walk);
  };
  walk(schema);
  return { kinds, fields };
}

/** Whether the result is that of a diagnosis. */
export const hasCauses = (id, result) => id === 'diagnosis' && Array.isArray(result?.causes);

/** Whether the heaviest set is one of the catalogue, and the rows object to it. */
const isObjected = ({ verdict, sets, unnamed_probability: unnamed }) => verdict === 'unknown' && sets[0]?.posterior > unnamed;

export function Causes({ result, schema, unit }) {
  const { kinds, fields } = useMemo(() => wordsOf(schema), [schema]);
  const nameOf = (kind, label) => `${kinds.get(kind)?.text ?? humanised(kind)}${label ? ` ${label}` : ''}`;
  // As inside a sentence.
  const spoken = kind => { const name = nameOf(kind); return name.charAt(0).toLowerCase() + name.slice(1); };
  const bars = [
    ...result.causes.filter(({ probability }) => probability >= LEAST_SHARE).sort((a, b) => b.probability - a.probability).slice(0, MOST_BARS)
      .map(({ kind, label, probability, confounded_with: like }) => ({ key: kind + label, name: nameOf(kind, label), share: probability, like, isNamed: result.named.some(one => one.kind === kind && one.label === label) })),
    { key: 'nothing', name: t('cause_none'), share: result.none_probability },
    { key: 'unknown', name: t('cause_unknown'), share: result.unnamed_probability },
  ];
  const like = bars.filter(({ isNamed, like: others }) => isNamed && others?.length > 0);
  const { gain, next_measurement: next } = result;
  return html`
    <section class="picture causes" aria-label=${t('causes_found')}>
      <h2>${t('causes_found')}</h2>
      <table><tbody>${bars.map(({ key, name, share, isNamed }) => html`<tr key=${key} class=${isNamed ? 'named' : ''}><th scope="row">${name}</th>
        <td class="clamp-bar"><svg viewBox=${`0 0 ${WIDTH} 14`} preserveAspectRatio="none" aria-hidden="true"><rect class=${isNamed ? 'clamp-given' : 'clamp-statics'} x="0" y="1" width=${Math.max(WIDTH * share, 2)} height="12" /></svg></td>
        <td class="number">${percent(share)}</td></tr>`)}</tbody></table>
      <p class="quiet">${t(isObjected(result) ? 'share_objected' : 'share_means')}</p>
      ${result.named.length > 0 && html`<ul class="sizes">${result.named.map(({ kind, label, parameters }) => html`<li key=${kind + label}><strong>${nameOf(kind, label)}</strong>${parameters.map(one => {
        const field = kinds.get(kind)?.properties[one.name];
        return html` · ${field ? labelOf(one.name, field) : humanised(one.name, one.unit)} ${one.standard_deviation ? withSpread(one.value, one.standard_deviation) : number(one.value, 4)} ${field ? unitOf(field) : unitSymbol(one.unit)}${one.at_limit ? ` (${t('at_limit')})` : ''}`;
      })}</li>`)}</ul>`}
      ${like.map(({ key, name, like: others }) => html`<p key=${key} class="quiet">${t('looks_like', { cause: name, others: others.map(spoken).join(', ') })}</p>`)}
      ${gain && html`<${Gain} ...${{ gain, unit }} />`}
      ${next && html`<h3>${t('next_measurement')}</h3>
        <p class="run">${Object.entries(next.run).map(([name, value]) => html`<span key=${name} class=${name === next.changes ? 'changed' : ''}>${fields.get(name) ? labelOf(name, fields.get(name)) : humanised(name)} ${typeof value === 'number' ? number(value, 4) : fields.get(name) ? wordOf(fields.get(name), value).toLowerCase() : String(value)} ${unitOf(fields.get(name))}</span>`)}</p>
        <p class="quiet">${t('next_separates', { leader: next.leader.map(spoken).join(' + '), rival: next.rival.map(spoken).join(' + '), now: number(next.separation_now_sigmas, 2), then: number(next.separation_then_sigmas, 2) })}</p>`}
    </section>`;
}

// No finite data make anything certain.
const percent = share => (share > 0.999 ? `> ${number(99.9)} %` : share > 0 && share < 0.001 ? `< ${number(0.1)} %` : `${number(100 * share, share > 0.99 ? 3 : 2)} %`);

/** The error on held-back data before and after, against what scatter and allowances leave to any model. */
function Gain({ gain, unit }) {
  const rows = [['base', t('error_base'), gain.rmse_base], ['extended', t('error_extended'), gain.rmse_extended], ...(typeof gain.noise_ceiling === 'number' ? [['noise', t('error_noise'), gain.noise_ceiling]] : [])];
  const most = Math.max(...rows.map(row => row[2]));
  return html`
    <h3>${t('held_back')}</h3>
    <table><tbody>${rows.map(([kind, name, error]) => html`<tr key=${kind}><th scope="row">${name}</th>
      <td class="clamp-bar"><svg viewBox=${`0 0 ${WIDTH} 14`} preserveAspectRatio="none" aria-hidden="true"><rect class=${{ base: 'clamp-entry', extended: 'clamp-given', noise: 'clamp-statics' }[kind]} x="0" y="1" width=${Math.max((WIDTH * error) / most, 2)} height="12" /></svg></td>
      <td class="number">${number(error, 3)} ${unit}</td></tr>`)}</tbody></table>`;
}
