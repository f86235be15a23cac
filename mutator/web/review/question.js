// @ts-check
"use strict";
// Asks for confirmation in the page's dialog `ask`.

const Question = (() => {
  const find = (id) => document.getElementById(id);

  /** Ask a question. `yes` is the label of the button, and `onYes()` is called when the user presses it. */
  function ask(title, about, yes, onYes) {
    const dialog = find("ask");
    find("ask-title").textContent = title;
    find("ask-about").textContent = about;
    find("ask-yes").textContent = yes;
    dialog.returnValue = "";
    dialog.showModal();
    find("ask-yes").focus();
    dialog.addEventListener("close", () => dialog.returnValue === "yes" && onYes(), { once: true });
  }

  return { ask };
})();
