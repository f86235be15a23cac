// What the compiler cannot know of a page. A script that looks an element up knows its kind from the HTML, and
// listeners get events of elements.

interface ParentNode {
  querySelector(selectors: string): any;
  querySelectorAll(selectors: string): NodeListOf<any>;
}

interface Document {
  getElementById(id: string): any;
}

interface Element extends HTMLOrSVGElement {}

interface EventTarget {
  blur(): void;
  closest(selectors: string): any;
  matches: any; // a method of elements
}

interface HTMLElementEventMap {
  filled: CustomEvent; // an experiment is shown
}

declare const uPlot: any; // mutator/web/uplot

declare const DOCUMENTATION_OPTIONS: { SHOW_SEARCH_SUMMARY: boolean }; // of Sphinx
