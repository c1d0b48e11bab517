/** Plain values in records and plots, facts, and words for names. */

export type Value = string | number | boolean | null | readonly Value[] | { readonly [name: string]: Value };
export type Named = Readonly<Record<string, Value>>;
/** Predicate, then arguments. */
export type Fact = readonly (string | number)[];

/** For each name that rules and handlers added to a plot, the words for people. */
export interface Words {
  readonly states?: Readonly<Record<string, string>>;
  readonly events?: Readonly<Record<string, string>>;
  readonly variables?: Readonly<Record<string, string>>;
}
