// The page's own few words, and how numbers are read and written. Everything else is worded by the service.
import { cell } from './lib.js';

const LANGUAGES = ['en', 'ru'];
const STORE = 'precut-language';
let words = {};
let current = 'en';

/** Counts the changes of the language: what is worded by the service has to be read again. */
export const languageChanged = cell(0);

export const language = () => current;
export const languages = LANGUAGES;

/** The text for `code`; `{name}` in it is replaced by the value of that name. */
export function t(code, values = {}) {
  const text = words[code];
  if (text === undefined) return code;
  return text.replace(/\{(\w+)\}/g, (whole, name) => (name in values ? values[name] : whole));
}

/** As a sentence or a label begins. Names of fields keep their small letters. */
export const capital = text => (!text || /^[a-z]+_/.test(text) ? text : text.charAt(0).toUpperCase() + text.slice(1));

/** The text for a count: forms by the language's own plural rules, `code.one`, `code.few`, `code.many`, `code.other`. */
export function plural(code, count, values = {}) {
  const rule = new Intl.PluralRules(current).select(count);
  const form = words[`${code}.${rule}`] !== undefined ? rule : 'other';
  return t(`${code}.${form}`, { count: number(count), ...values });
}

const wished = () => {
  let kept = null;
  try {
    kept = localStorage.getItem(STORE);
  } catch {
    /* private browsing */
  }
  if (LANGUAGES.includes(kept)) return kept;
  const own = (navigator.languages || [navigator.language]).map(tag => tag.slice(0, 2));
  return own.find(tag => LANGUAGES.includes(tag)) || 'en';
};

export async function speak(tag = wished()) {
  const response = await fetch(new URL(`./text/${tag}.json`, import.meta.url));
  if (!response.ok) throw new Error(`no texts in ${tag}`);
  words = await response.json();
  current = tag;
  document.documentElement.lang = tag;
  try {
    localStorage.setItem(STORE, tag);
  } catch {
    /* asked for again next time */
  }
  languageChanged.set(languageChanged.get() + 1);
}

export const decimalMark = () => (current === 'ru' ? ',' : '.');

const SUPERSCRIPT = { '-': '⁻', 0: '⁰', 1: '¹', 2: '²', 3: '³', 4: '⁴', 5: '⁵', 6: '⁶', 7: '⁷', 8: '⁸', 9: '⁹' };
export const superscript = text => [...String(text)].map(c => SUPERSCRIPT[c] || c).join('');

/** A number with at most `digits` significant digits, in the language's writing. */
export function number(value, digits = 6) {
  if (value === null || value === undefined || Number.isNaN(value)) return '–';
  if (value === 0) return '0';
  if (!Number.isFinite(value)) return value > 0 ? '∞' : '−∞';
  const rounded = Number(value.toPrecision(digits));
  const size = Math.abs(rounded);
  let text;
  if (size >= 1e7 || size < 1e-4) {
    const [mantissa, power] = rounded.toExponential().split('e');
    text = `${mantissa}·10${superscript(Number(power))}`;
  } else {
    text = String(rounded);
  }
  text = text.replace('-', '−').replace('.', decimalMark());
  return text.replace(/^(−?)(\d{5,})/, (_, sign, whole) => sign + whole.replace(/\B(?=(\d{3})+$)/g, '\u202f'));
}

/** A number as it is typed: all its digits, nothing between them. */
export const typed = value => (value === null || value === undefined ? '' : String(value).replace('.', decimalMark()));

/** A length of time in words: `3 s`, `2 min 5 s`. */
export function duration(ms) {
  if (ms < 950) return `${number(Math.max(ms, 0), 2)} ${t('unit_ms')}`;
  const s = Math.round(ms / 1000);
  if (s < 60) return `${s} ${t('unit_s')}`;
  const min = Math.floor(s / 60);
  return min < 60
    ? `${min} ${t('unit_min')} ${s % 60} ${t('unit_s')}`
    : `${Math.floor(min / 60)} ${t('unit_h')} ${min % 60} ${t('unit_min')}`;
}

export const moment = text => new Date(text).toLocaleString(current, { dateStyle: 'short', timeStyle: 'medium' });

const SYMBOLS = { um: 'µm', us: 'µs', urad: 'µrad', deg: '°' };
const RUSSIAN = {
  mm: 'мм',
  um: 'мкм',
  m: 'м',
  N: 'Н',
  kN: 'кН',
  W: 'Вт',
  kW: 'кВт',
  s: 'с',
  ms: 'мс',
  us: 'мкс',
  min: 'мин',
  h: 'ч',
  rpm: 'об/мин',
  rev: 'об',
  tooth: 'зуб',
  kg: 'кг',
  Hz: 'Гц',
  rad: 'рад',
  urad: 'мкрад',
  K: 'К',
  mK: 'мК',
  km: 'км',
  MPa: 'МПа',
  GPa: 'ГПа',
  g: 'г',
  J: 'Дж',
  nm: 'нм',
  cm: 'см',
  inch: 'дюйм',
  money: 'ден.\u00a0ед.',
};

/** The symbol of a unit of the contract: `um/N` becomes `µm/N` or `мкм/Н`, `N/mm2` becomes `N/mm²`. */
export function unitSymbol(unit) {
  // A unit that another field says is not known here.
  if (!unit || unit === '1' || unit.startsWith('as ')) return '';
  if (unit === 'percent') return '%';
  const spell = word => (current === 'ru' && RUSSIAN[word]) || SYMBOLS[word] || word;
  return unit.replace(/([A-Za-zµ]+)(-?\d*)/g, (_, word, power) => spell(word) + superscript(power)).replace(/[* ]/g, '·');
}

// Who writes milli does not mean mega: of that no capitals are mixed up.
const spellings = symbol => (symbol.startsWith('М') ? [symbol] : [symbol, symbol.toLowerCase()]);
const WORDS = new Map([
  ...Object.entries(RUSSIAN).flatMap(([word, symbol]) => spellings(symbol).map(text => /** @type {[string, string]} */ ([text, word]))),
  /** @type {[string, string]} */ (['град', 'deg']),
]);
/** A unit with the words of the contract, as far as it is written with those of print: `мкм/об` becomes `um/rev`. */
export const unitWords = unit => unit.replace(/[а-яё]+/gi, word => WORDS.get(word) ?? WORDS.get(word.toLowerCase()) ?? word);

/** The unit of a field as it is printed. */
export const unitOf = schema => schema?.['x-unit-label'] ?? unitSymbol(schema?.['x-unit']);
