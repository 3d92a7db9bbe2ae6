// Units in which a measured table may come: the service converts between those of one dimension. Here are its own
// spellings, those of one unit together, the one that is printed first: `src/units.rs` has the same, and a test compares.
import { unitWords } from './text.js';

export const DIMENSIONS = [
  [['mm'], ['um', 'µm', 'μm'], ['nm'], ['cm'], ['m'], ['km'], ['inch', 'in'], ['uin', 'µin', 'μin'], ['thou', 'mil'], ['ft']],
  [['mm/rev', 'mm/r'], ['um/rev', 'µm/rev', 'μm/rev'], ['inch/rev', 'in/rev', 'ipr'], ['thou/rev', 'mil/rev']],
  [['mm/tooth', 'mm/z'], ['um/tooth', 'µm/tooth', 'μm/tooth'], ['inch/tooth', 'in/tooth', 'ipt'], ['thou/tooth', 'mil/tooth']],
  [['m/min'], ['mm/min'], ['m/s'], ['mm/s'], ['ft/min', 'sfm', 'fpm'], ['ft/s'], ['inch/min', 'in/min', 'ipm']],
  [['rpm', '1/min', 'rev/min'], ['rev/s'], ['rad/s']],
  [['Hz', '1/s'], ['kHz']],
  [['deg', '°'], ['rad'], ['mrad'], ['arcmin'], ['arcsec']],
  [['N'], ['daN'], ['kN'], ['MN'], ['lbf'], ['klbf', 'kip'], ['kgf', 'kp']],
  [['N m', 'Nm', 'N*m'], ['N mm', 'Nmm', 'N*mm'], ['N cm', 'Ncm', 'N*cm'], ['kN m', 'kNm', 'kN*m'], ['lbf ft', 'ft lbf', 'lbf*ft', 'ft*lbf'], ['lbf inch', 'lbf in', 'in lbf', 'lbf*in', 'in*lbf'], ['kgf m', 'kgf*m']],
  [['N/mm2', 'N/mm²', 'N/mm^2', 'MPa'], ['Pa', 'N/m2', 'N/m²', 'N/m^2'], ['kPa'], ['GPa', 'kN/mm2', 'kN/mm²', 'kN/mm^2'], ['bar'], ['psi', 'lbf/in2', 'lbf/in²', 'lbf/in^2'], ['ksi'], ['kgf/mm2', 'kgf/mm²', 'kgf/mm^2'], ['kgf/cm2', 'kgf/cm²', 'kgf/cm^2']],
  [['N/mm', 'kN/m'], ['N/um', 'N/µm', 'N/μm', 'kN/mm', 'MN/m'], ['N/m'], ['lbf/inch', 'lbf/in'], ['kgf/mm']],
  [['um/N', 'µm/N', 'μm/N', 'mm/kN'], ['mm/N'], ['m/N'], ['nm/N', 'um/kN', 'µm/kN', 'μm/kN'], ['inch/lbf', 'in/lbf'], ['uin/lbf', 'µin/lbf', 'μin/lbf']],
  [['kW'], ['W'], ['MW'], ['hp'], ['PS']],
  [['s', 'sec'], ['ms'], ['us', 'µs', 'μs'], ['min'], ['h']],
  [['kg'], ['g'], ['t'], ['lb', 'lbm']],
  [['kg/m3', 'kg/m³', 'kg/m^3'], ['g/cm3', 'g/cm³', 'g/cm^3', 'kg/dm3', 't/m3', 't/m³', 't/m^3'], ['lb/in3', 'lb/in³', 'lb/in^3']],
  [['N s/mm', 'N*s/mm', 'Ns/mm', 'kN s/m', 'kN*s/m', 'kNs/m'], ['N s/m', 'N*s/m', 'Ns/m'], ['lbf s/inch', 'lbf s/in', 'lbf*s/in']],
  [['1'], ['%', 'percent']],
  [['K', '°C', 'degC'], ['°F', 'degF']],
  [['um/(m K)', 'um/m/K', 'µm/(m K)', '1e-6/K', 'ppm/K'], ['1/K'], ['1/°F', '1/degF']],
  [['m/s2', 'm/s²', 'm/s^2'], ['mm/s2', 'mm/s²', 'mm/s^2'], ['ft/s2', 'ft/s²', 'ft/s^2']],
];

/** The spellings of every unit into which the service converts a unit, its own among them. */
const alike = unit => DIMENSIONS.find(units => units.some(spellings => spellings.includes(unit))) || [[unit]];

/** The unit as a choice has it: by its first spelling. */
export const named = unit => alike(unit).find(spellings => spellings.includes(unit))[0];

/** The units that the numbers of a column may have whose field has this one. */
export const choicesOf = unit => alike(unit).map(([first]) => first);

/** Ways to write one and the same: signs of print and of the keyboard, words of either language. */
const plain = text => unitWords(text.trim()).replace(/[µμ]/g, 'u').replace(/²/g, '2').replace(/³/g, '3').replace(/\^/g, '').replace(/[*·⋅]/g, ' ').replace(/°/g, 'deg').replace(/\s+/g, ' ');

/** The unit that was written, among those of the field's own; `null` where it is none of them. */
export function unitIn(text, own) {
  const written = plain(text);
  const units = alike(own);
  const found = units.find(spellings => spellings.some(one => plain(one) === written))
    // Small letters and capitals are mixed up, but who writes milli does not mean mega.
    ?? units.find(spellings => spellings.some(one => !one.startsWith('M') && plain(one).toLowerCase() === written.toLowerCase()));
  return found ? found[0] : null;
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
export const endsOf = own => alike(own)
  .flatMap(spellings => spellings.map(one => ({ end: suffixOf(one), unit: spellings[0] })))
  .filter(({ end }) => end !== '')
  .sort((a, b) => b.end.length - a.end.length);
