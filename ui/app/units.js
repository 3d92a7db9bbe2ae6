// Units in which numbers may come: the service converts those of a measured table, the page one that is typed with its
// unit behind it. Here are the sizes and spellings of `src/units.rs`, those of one dimension in a line, the spelling that
// is printed first; a test compares.
import { unitWords } from './text.js';

/** @type {[number, ...string[]][][]} */
export const SIZES = [
  [
    [1, 'mm'],
    [0.001, 'um', 'µm', 'μm'],
    [1e-6, 'nm'],
    [10, 'cm'],
    [1000, 'm'],
    [1000000, 'km'],
    [25.4, 'inch', 'in'],
    [2.54e-5, 'uin', 'µin', 'μin'],
    [0.0254, 'thou', 'mil'],
    [304.8, 'ft'],
  ],
  [
    [1, 'mm/rev', 'mm/r'],
    [0.001, 'um/rev', 'µm/rev', 'μm/rev'],
    [25.4, 'inch/rev', 'in/rev', 'ipr'],
    [0.0254, 'thou/rev', 'mil/rev'],
  ],
  [
    [1, 'mm/tooth', 'mm/z'],
    [0.001, 'um/tooth', 'µm/tooth', 'μm/tooth'],
    [25.4, 'inch/tooth', 'in/tooth', 'ipt'],
    [0.0254, 'thou/tooth', 'mil/tooth'],
  ],
  [
    [1000, 'm/min'],
    [1, 'mm/min'],
    [60000, 'm/s'],
    [60, 'mm/s'],
    [304.8, 'ft/min', 'sfm', 'fpm'],
    [18288, 'ft/s'],
    [25.4, 'inch/min', 'in/min', 'ipm'],
  ],
  [
    [1, 'rpm', '1/min', 'rev/min'],
    [60, 'rev/s'],
    [30 / Math.PI, 'rad/s'],
  ],
  [
    [1, 'Hz', '1/s'],
    [1000, 'kHz'],
  ],
  [
    [1, 'deg', '°'],
    [180 / Math.PI, 'rad'],
    [0.18 / Math.PI, 'mrad'],
    [0.016666666666666666, 'arcmin'],
    [0.0002777777777777778, 'arcsec'],
  ],
  [
    [1, 'N'],
    [10, 'daN'],
    [1000, 'kN'],
    [1000000, 'MN'],
    [4.4482216152605, 'lbf'],
    [4448.2216152605, 'klbf', 'kip'],
    [9.80665, 'kgf', 'kp'],
  ],
  [
    [1, 'N m', 'Nm', 'N*m'],
    [0.001, 'N mm', 'Nmm', 'N*mm'],
    [0.01, 'N cm', 'Ncm', 'N*cm'],
    [1000, 'kN m', 'kNm', 'kN*m'],
    [1.3558179483314003, 'lbf ft', 'ft lbf', 'lbf*ft', 'ft*lbf'],
    [0.1129848290276167, 'lbf inch', 'lbf in', 'in lbf', 'lbf*in', 'in*lbf'],
    [9.80665, 'kgf m', 'kgf*m'],
  ],
  [
    [1, 'N/mm2', 'N/mm²', 'N/mm^2', 'MPa'],
    [1e-6, 'Pa', 'N/m2', 'N/m²', 'N/m^2'],
    [0.001, 'kPa'],
    [1000, 'GPa', 'kN/mm2', 'kN/mm²', 'kN/mm^2'],
    [0.1, 'bar'],
    [0.006894757293168362, 'psi', 'lbf/in2', 'lbf/in²', 'lbf/in^2'],
    [6.894757293168361, 'ksi'],
    [9.80665, 'kgf/mm2', 'kgf/mm²', 'kgf/mm^2'],
    [0.0980665, 'kgf/cm2', 'kgf/cm²', 'kgf/cm^2'],
  ],
  [
    [1, 'N/mm', 'kN/m'],
    [1000, 'N/um', 'N/µm', 'N/μm', 'kN/mm', 'MN/m'],
    [0.001, 'N/m'],
    [0.17512683524647638, 'lbf/inch', 'lbf/in'],
    [9.80665, 'kgf/mm'],
  ],
  [
    [1, 'um/N', 'µm/N', 'μm/N', 'mm/kN'],
    [1000, 'mm/N'],
    [1000000, 'm/N'],
    [0.001, 'nm/N', 'um/kN', 'µm/kN', 'μm/kN'],
    [5710.147154732646, 'inch/lbf', 'in/lbf'],
    [0.0057101471547326465, 'uin/lbf', 'µin/lbf', 'μin/lbf'],
  ],
  [
    [1, 'kW'],
    [0.001, 'W'],
    [1000, 'MW'],
    [0.7456998715822702, 'hp'],
    [0.73549875, 'PS'],
  ],
  [
    [1, 's', 'sec'],
    [0.001, 'ms'],
    [1e-6, 'us', 'µs', 'μs'],
    [60, 'min'],
    [3600, 'h'],
  ],
  [
    [1, 'kg'],
    [0.001, 'g'],
    [1000, 't'],
    [0.45359237, 'lb', 'lbm'],
  ],
  [
    [1, 'kg/m3', 'kg/m³', 'kg/m^3'],
    [1000, 'g/cm3', 'g/cm³', 'g/cm^3', 'kg/dm3', 't/m3', 't/m³', 't/m^3'],
    [27679.90471020312, 'lb/in3', 'lb/in³', 'lb/in^3'],
  ],
  [
    [1, 'N s/mm', 'N*s/mm', 'Ns/mm', 'kN s/m', 'kN*s/m', 'kNs/m'],
    [0.001, 'N s/m', 'N*s/m', 'Ns/m'],
    [0.17512683524647638, 'lbf s/inch', 'lbf s/in', 'lbf*s/in'],
  ],
  [
    [1, '1'],
    [0.01, '%', 'percent'],
  ],
  [
    [1, 'K', '°C', 'degC'],
    [0.5555555555555556, '°F', 'degF'],
  ],
  [
    [1, 'um/(m K)', 'um/m/K', 'µm/(m K)', '1e-6/K', 'ppm/K'],
    [1000000, '1/K'],
    [1800000, '1/°F', '1/degF'],
  ],
  [
    [1, 'm/s2', 'm/s²', 'm/s^2'],
    [0.001, 'mm/s2', 'mm/s²', 'mm/s^2'],
    [0.3048, 'ft/s2', 'ft/s²', 'ft/s^2'],
  ],
];

/** The spellings alone. */
export const DIMENSIONS = SIZES.map(units => units.map(([, ...spellings]) => spellings));

/** The spellings of every unit into which the service converts a unit, its own among them. */
const alike = unit => DIMENSIONS.find(units => units.some(spellings => spellings.includes(unit))) || [[unit]];

/** The unit as a choice has it: by its first spelling. */
export const named = unit => alike(unit).find(spellings => spellings.includes(unit))[0];

/** The units that the numbers of a column may have whose field has this one. */
export const choicesOf = unit => alike(unit).map(([first]) => first);

/** Ways to write one and the same: signs of print and of the keyboard, words of either language. */
const plain = text =>
  unitWords(text.trim())
    .replace(/[µμ]/g, 'u')
    .replace(/²/g, '2')
    .replace(/³/g, '3')
    .replace(/\^/g, '')
    .replace(/[*·⋅]/g, ' ')
    .replace(/°/g, 'deg')
    .replace(/\s+/g, ' ');

/** The unit that was written, among those of the field's own; `null` where it is none of them. */
export function unitIn(text, own) {
  const written = plain(text);
  const units = alike(own);
  const found =
    units.find(spellings => spellings.some(one => plain(one) === written)) ??
    // Small letters and capitals are mixed up, but who writes milli does not mean mega.
    units.find(spellings => spellings.some(one => !one.startsWith('M') && plain(one).toLowerCase() === written.toLowerCase()));
  return found ? found[0] : null;
}

/** A number of unit `from` in unit `to`, both of one dimension; to twelve digits, so that 2.36 in are 59.944 mm. */
export function converted(value, from, to) {
  if (named(from) === named(to)) return value;
  const size = unit => SIZES.flat().find(([, ...spellings]) => spellings.includes(unit))[0];
  return Number(((value * size(from)) / size(to)).toPrecision(12));
}

/** How a unit stands at the end of a field's name: `um_per_n` for `um/N`, nothing for a number without one. */
function suffixOf(unit) {
  if (['', '1', 'money'].includes(unit)) return '';
  if (unit === '%') return 'percent';
  if (unit === 'rev/min') return 'rpm';
  return plain(unit).replace(/\//g, ' per ').replace(/[()]/g, '').trim().toLowerCase().replace(/\s+/g, '_');
}

/** A field's name without the unit at its end. */
export function stemOf(name, unit) {
  const end = suffixOf(unit ?? '');
  return end !== '' && name.endsWith(`_${end}`) ? name.slice(0, -end.length - 1) : name;
}

/** The ends that a name may have which says the unit itself, each with its unit, the longest first. */
export const endsOf = own =>
  alike(own)
    .flatMap(spellings => spellings.map(one => ({ end: suffixOf(one), unit: spellings[0] })))
    .filter(({ end }) => end !== '')
    .sort((a, b) => b.end.length - a.end.length);
