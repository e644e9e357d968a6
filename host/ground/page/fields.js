// What the interface tables say of a field.

// The name of its value among the fields of a frame; none where it has no name.
export function named(field, values) {
  const value = Number(values[field.name]);
  const [other, sets] = field.choices_by ?? [];
  const choices = field.choices ?? sets?.[Number(values[other])] ?? {};
  return Object.keys(choices).find((name) => choices[name] === value);
}

export function hasNames(field) {
  return Boolean(field.choices ?? field.choices_by);
}
