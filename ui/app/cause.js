// Causes that were weighed, at a glance: how likely each is, its size, what the data cannot tell apart, what is gained on data
// that was held back, and the measurement worth making next. A result has them where its schema says so (`x-causes` at a field
// of an item of their list).
import { html, useMemo } from './lib.js';
import { t, capital, number, unitSymbol, unitOf } from './text.js';
import { humanised, labelOf, listsWith, resolve, variants, within } from './schema.js';
import { withSpread } from './digits.js';
import { SheetButtons } from './inspection.js';

const WIDTH = 1000;
/** So many causes are drawn. */
const MOST_BARS = 6;
/** A cause less likely than this is not drawn. */
const LEAST_SHARE = 0.005;
const UM_PER_MM = 1000;

/** A word of a choice as it stands in a sentence. */
const labelled = (schema, word) => schema?.['x-labels']?.[word] ?? humanised(word).toLowerCase();

/** What a diagnosis of this calculator answers: one of the schemas that all diagnoses have together. */
export function answerSchema({ input_schema: inputs, output_schema: outputs }, calculator) {
  const jobs = inputs.oneOf || [];
  const at = variants({ oneOf: jobs }, inputs).findIndex(({ tag, value }) => tag === 'calculator' && value === calculator);
  const answers = outputs.oneOf || outputs.anyOf || [outputs];
  const twin = jobs[at]?.$ref?.replace(/Job$/, 'Result');
  return resolve(answers.find(({ $ref }) => $ref && $ref === twin) || answers[at] || answers[0], outputs);
}

/** What the diagnosis of this calculator has words for: its effects by their kinds, and the conditions of a run. */
function wordsOf(description, calculator) {
  const root = description.output_schema;
  const own = answerSchema(description, calculator).properties;
  const effects = variants(resolve(resolve(own.effects, root).items, root), root);
  const next = resolve(own.next_measurement, root).properties;
  return {
    kinds: new Map(
      effects.map(({ schema, tag, value }) => [
        value,
        { text: labelled(resolve(schema.properties[tag], root), value), properties: schema.properties },
      ]),
    ),
    conditions: new Map(Object.entries(resolve(next.run, root).properties || {}).map(([name, field]) => [name, resolve(field, root)])),
  };
}

/** The causes of an answer with the words for them; `null` for an answer without. `unit` is that of the errors, empty for
 *  logarithms; `isSilent` says that it was refused to say anything of them. */
export function causesOf(description, { result, input: { calculator } }, figures) {
  const root = description.output_schema;
  const [list] = listsWith('x-causes', root, result, answerSchema(description, calculator));
  if (!list) return null;
  const unit = figures.find(({ id }) => id === list.said.errors_as_in)?.panels[0]?.y.unit;
  return {
    result,
    ...wordsOf(description, calculator),
    unit: unit === undefined ? undefined : unitSymbol(unit),
    named: result.named ?? [],
    isNamed: result.verdict === 'named',
    isSilent: result.verdict === 'refused',
  };
}

/** What the picture of the causes tells already. */
export const saidOfCauses = code => ['diagnosis_next', 'diagnosis_gain'].includes(code);

/** Whether the heaviest set is one of the catalogue, and the rows object to it. */
const isObjected = ({ verdict, sets, unnamed_probability: unnamed }) => verdict === 'unknown' && sets[0]?.posterior > unnamed;

const isSame = (one, other) => one.kind === other.kind && one.label === other.label;

/** Two parts of one wave, `..._cos_...` and `..._sin_...`, as its amplitude. */
function amplitudeOf(cos, sin, properties) {
  const name = `${cos.name.split('_cos_')[0]}_${cos.unit}`;
  const value = Math.hypot(cos.value, sin.value);
  const spread = Math.hypot(cos.value * (cos.standard_deviation || 0), sin.value * (sin.standard_deviation || 0)) / (value || 1);
  return {
    name: properties?.[name] ? labelOf(name, properties[name]) : humanised(name, cos.unit),
    value,
    spread,
    unit: cos.unit,
    isFine: true,
    atLimit: cos.at_limit || sin.at_limit,
  };
}

/** The sizes of a cause as they are told: a logarithm as the factor that it is, the two parts of a wave as one amplitude,
 *  what a wave or a run-out measures in µm. `unit` is that of the quantity, empty where it is judged by its logarithm. */
export function sizesOf(parameters, properties, unit) {
  const twins = new Map(
    parameters
      .filter(({ name }) => name.includes('_cos_'))
      .map(cos => [cos, parameters.find(({ name }) => name === cos.name.replace('_cos_', '_sin_'))])
      .filter(([, sin]) => sin),
  );
  const parts = [...twins.values()];
  return parameters
    .filter(one => !parts.includes(one))
    .map(one => {
      if (twins.has(one)) return amplitudeOf(one, twins.get(one), properties);
      const field = properties?.[one.name];
      const told = {
        name: field ? labelOf(one.name, field) : one.name === 'kappa' ? t('size_share') : humanised(one.name, one.unit),
        value: one.value,
        spread: one.standard_deviation,
        unit: one.unit,
        shown: field && unitOf(field),
        isFine: /^(amplitude|runout)_/.test(one.name),
        atLimit: one.at_limit,
      };
      const isLog = one.name.startsWith('ln_') || one.name.endsWith('_ln');
      if (!isLog) return told;
      // A model that is no power law takes the same number as an addition to its output.
      if (one.name.endsWith('_ln') && unit) return { ...told, name: t('size_change'), unit, shown: unit };
      const factor = Math.exp(one.value);
      return {
        ...told,
        name: t(one.name === 'hump_ln' ? 'size_factor_largest' : 'size_factor'),
        value: factor,
        spread: factor * one.standard_deviation,
        shown: '',
      };
    })
    .map(size =>
      size.isFine && size.unit === 'mm'
        ? { ...size, value: UM_PER_MM * size.value, spread: UM_PER_MM * size.spread, unit: 'um', shown: undefined }
        : size,
    );
}

/** How the causes of a diagnosis are called. */
function namer(kinds) {
  // Which of several of its kind: an order, a place, or a name that the user gave.
  const whichOf = (kind, label) => {
    const [, order] = /^order ([\d.]+)$/.exec(label) || [];
    const [, place] = /^([\d.]+) mm$/.exec(label) || [];
    const field = order && kinds.get(kind)?.properties.order;
    return field
      ? `${within(labelOf('order', field))} ${number(Number(order))}`
      : place
        ? `${number(Number(place))} ${unitSymbol('mm')}`
        : label;
  };
  // As inside a sentence.
  const spoken = kind => kinds.get(kind)?.text ?? labelled(null, kind);
  return { spoken, nameOf: (kind, label) => `${capital(spoken(kind))}${label ? ` (${whichOf(kind, label)})` : ''}` };
}

/** The set of causes that an answer names: it and nothing beside it. */
const exactSet = ({ verdict, sets, named }) =>
  verdict === 'named'
    ? sets.find(
        ({ causes, with_remainder: rest }) =>
          !rest && causes.length === named.length && causes.every(one => named.some(other => isSame(one, other))),
      )
    : undefined;

/** An error as it is told; `unit` is empty where the quantity is judged by its logarithm: its errors are shares then. */
const errorOf = (error, unit) => (unit === '' ? number(100 * error, 3) : number(error, 3));

/** The numbers of a diagnosis that matter at a glance: what is named, or may act, with its probability, how large it is, and
 *  what it gains on data that was held back. None where nothing is said of causes. */
export function causesHeadline(causes) {
  if (!causes) return null;
  if (causes.isSilent) return [];
  const { result, kinds, unit } = causes;
  const { nameOf } = namer(kinds);
  const setName = causes => (causes.length > 0 ? causes.map(({ kind, label }) => nameOf(kind, label)).join(' + ') : t('cause_none'));
  const { gain } = result;
  const gained = gain
    ? [
        {
          label: t('held_back'),
          text: `${errorOf(gain.rmse_base, unit)} → ${errorOf(gain.rmse_extended, unit)}`,
          unit: unit === '' ? '%' : unit,
        },
      ]
    : [];
  const share = (label, probability) => ({ label, text: percent(probability) });
  if (result.verdict === 'named') {
    const [first] = result.named;
    const sizes = sizesOf(first.parameters, kinds.get(first.kind)?.properties, unit);
    // Of which mode it is stands in its name: what was fitted is the size.
    const size = sizes.find(({ spread }) => typeof spread === 'number') ?? sizes[0];
    const likely =
      exactSet(result)?.posterior ??
      Math.min(...result.causes.filter(cause => result.named.some(one => isSame(one, cause))).map(cause => cause.probability));
    return [
      share(setName(result.named), likely),
      ...gained,
      ...(size ? [{ label: size.name, text: sizeText(size), unit: size.shown ?? unitSymbol(size.unit) }] : []),
    ];
  }
  if (result.verdict === 'adequate')
    return [share(t('cause_none'), result.none_probability), share(t('cause_unknown'), result.unnamed_probability), ...gained];
  if (result.verdict === 'confounded')
    return [...result.likely_sets.slice(0, 2).map(({ causes, posterior }) => share(setName(causes), posterior)), ...gained];
  return [
    ...(isObjected(result) ? [] : [share(t('cause_unknown'), result.unnamed_probability)]),
    share(t('cause_none'), result.none_probability),
    ...gained,
  ];
}

const sizeText = ({ value, spread }) => (spread ? withSpread(value, spread) : number(value, 4));
const said = size =>
  `${size.name} ${[sizeText(size), size.shown ?? unitSymbol(size.unit)].filter(Boolean).join(' ')}${size.atLimit ? ` (${t('at_limit')})` : ''}`;

/** A condition of a run as it is told; what the user named keeps its letters. */
function conditionOf(name, value, field) {
  const label = field ? labelOf(name, field) : humanised(name);
  if (Array.isArray(value)) return value.map(one => (one.factor ? `${one.factor} ${one.level}` : String(one))).join(', ');
  const text =
    typeof value === 'number'
      ? number(value, 4)
      : typeof value === 'boolean'
        ? t(value ? 'yes' : 'no')
        : field?.enum
          ? labelled(field, value)
          : String(value);
  return [label, text, unitOf(field)].filter(Boolean).join(' ');
}

/** Whether a next measurement is advised: of what the list does not hold none can be told apart. */
// A run of which too many would be needed is no advice.
const advisesNext = result => Boolean(result.next_measurement?.rows_needed) && (result.verdict !== 'unknown' || result.named.length > 0);
export const nextAdvised = causes => Boolean(causes && !causes.isSilent && advisesNext(causes.result));

export function Causes({ causes: { result, kinds, conditions, unit, isSilent }, sheet, answer, title, name, owns, stale }) {
  const { spoken, nameOf } = useMemo(() => namer(kinds), [kinds]);
  const times = (kind, list) => {
    const count = list.filter(other => other === kind).length;
    return count > 1 ? `${count} × ${spoken(kind)}` : spoken(kind);
  };
  const set = list => (list.length > 0 ? [...new Set(list)].map(kind => times(kind, list)).join(' + ') : t('the_base'));
  const isUnknown = result.verdict === 'unknown';
  const isDenied = isObjected(result);
  const likely = (result.causes ?? [])
    .slice()
    .sort((a, b) => b.probability - a.probability)
    .map(cause => ({
      ...cause,
      key: cause.kind + cause.label,
      name: nameOf(cause.kind, cause.label),
      share: cause.probability,
      like: cause.confounded_with,
      isNamed: result.named.some(one => isSame(one, cause)),
    }));
  const named = likely.filter(({ isNamed }) => isNamed);
  const others = likely.filter(({ isNamed, share }) => !isNamed && share >= LEAST_SHARE).slice(0, Math.max(0, MOST_BARS - named.length));
  const none = { key: 'nothing', name: t('cause_none'), share: result.none_probability, isAnswer: result.verdict === 'adequate' };
  const unnamed = { key: 'unknown', name: t('cause_unknown'), share: isDenied ? null : result.unnamed_probability, isAnswer: isUnknown };
  const bars = isUnknown ? [unnamed, ...named, none] : [...named, ...others, none, unnamed];
  const nearest = isUnknown ? others.map(bar => ({ ...bar, length: bar.share, share: null })) : [];
  const like = named.filter(bar => bar.like?.length > 0);
  const { gain, next_measurement: next } = result;
  const exact = exactSet(result);
  if (isSilent) return null;
  return html`
    <section class="picture causes" aria-label=${t('causes_found')}>
      <h2>${t('causes_found')}</h2>
      <table>
        <tbody>${bars.map(bar => html`<${Bar} key=${bar.key} ...${bar} />`)}</tbody>
        ${nearest.length > 0 && html`<tbody class="nearest"><tr><th scope="rowgroup" colspan="3">${t('nearest_listed')}</th></tr>${nearest.map(bar => html`<${Bar} key=${bar.key} ...${bar} />`)}</tbody>`}
      </table>
      <p class="quiet">${isDenied ? t('share_objected') : nearest.length > 0 ? t('share_unnamed') : t('share_means')}${exact && exact.posterior < 0.999 ? ` ${t('share_exact', { share: percent(exact.posterior) })}` : ''}</p>
      ${result.named.length > 0 && html`<ul class="sizes">${result.named.map(({ kind, label, parameters }) => html`<li key=${kind + label}><strong>${nameOf(kind, label)}</strong>${sizesOf(parameters, kinds.get(kind)?.properties, unit).map(size => ` · ${said(size)}`)}</li>`)}</ul>`}
      ${like.map(({ key, name, like: twins }) => html`<p key=${key} class="quiet">${t('looks_like', { cause: name, others: twins.map(spoken).join(', ') })}</p>`)}
      ${gain && html`<${Gain} ...${{ gain, unit, isNamed: named.length > 0 }} />`}
      ${
        advisesNext(result) &&
        html`<h3>${t('next_measurement')}</h3>
        ${[next, ...(next.further_runs ?? [])].map((own, index) => html`<${NextRun} key=${index} ...${{ own, conditions }} />`)}
        <p class="quiet">${t('next_separates', { leader: set(next.leader), rival: set(next.rival), now: number(next.separation_now_sigmas, 2), after: number(next.separation_then_sigmas, 2) })}</p>
        ${sheet && html`<${SheetButtons} ...${{ sheet, answer, name, owns, stale, title }} />`}`
      }
    </section>`;
}

/** The conditions of a run that is worth measuring, those that it changes marked. */
function NextRun({ own: { run, changes }, conditions }) {
  const stated = Object.entries(run).filter(([, value]) => value !== null && !(Array.isArray(value) && value.length === 0));
  return html`
    <p class="run">${stated.map(
      ([name, value]) =>
        html`<span key=${name} class=${changes.split(', ').includes(name) ? 'changed' : ''}>${conditionOf(name, value, conditions.get(name))}</span>`,
    )}</p>`;
}

/** A share as a bar: solid for what the answer names, hollow for all else; of what only comes near no number is told. */
function Bar({ name, share, length = share ?? 1, isNamed = false, isAnswer = false }) {
  const isSolid = isNamed || isAnswer;
  return html`
    <tr class=${isNamed ? 'named' : isAnswer ? 'answer' : ''}><th scope="row">${name}</th>
      <td class="clamp-bar"><svg viewBox=${`0 0 ${WIDTH} 14`} preserveAspectRatio="none" aria-hidden="true"><rect class=${isNamed ? 'bar-given' : isAnswer ? 'share-answer' : 'share-hollow'} x="0" y="1" width=${Math.max(WIDTH * length, isSolid ? 2 : 6)} height="12" vector-effect="non-scaling-stroke" /></svg></td>
      <td class="number">${share === null ? '' : percent(share)}</td></tr>`;
}

// No finite data make anything certain.
const percent = share =>
  share > 0.999
    ? `> ${number(99.9)} %`
    : share > 0 && share < 0.001
      ? `< ${number(0.1)} %`
      : `${number(100 * share, share > 0.99 ? 3 : 2)} %`;

/** The error on held-back data before and after, against what scatter and allowances leave to any model. */
function Gain({ gain, unit, isNamed }) {
  const isWorse = gain.rmse_extended >= gain.rmse_base;
  const rows = [
    ['bar-third', t('error_base'), gain.rmse_base],
    [isWorse ? 'gain-none' : isNamed ? 'bar-given' : 'bar-second', t(isNamed ? 'error_extended' : 'error_chosen'), gain.rmse_extended],
    ...(typeof gain.noise_ceiling === 'number' ? [['bar-first', t('error_noise'), gain.noise_ceiling]] : []),
  ];
  const most = Math.max(...rows.map(row => row[2]));
  const told = error => `${errorOf(error, unit)} ${unit === '' ? '%' : (unit ?? '')}`;
  return html`
    <h3>${t('held_back')}</h3>
    <table><tbody>${rows.map(
      ([look, name, error]) => html`<tr key=${look}><th scope="row">${name}</th>
      <td class="clamp-bar"><svg viewBox=${`0 0 ${WIDTH} 14`} preserveAspectRatio="none" aria-hidden="true"><rect class=${look} x="0" y="1" width=${Math.max((WIDTH * error) / most, 2)} height="12" /></svg></td>
      <td class="number">${told(error)}</td></tr>`,
    )}</tbody></table>
    ${isWorse && html`<p class="quiet">${t('gain_none')}</p>`}`;
}
