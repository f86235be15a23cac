"use strict";
// A question with one way to say yes, in the page's dialog `ask`.

const Question = (() => {
  const find = (id) => document.getElementById(id);

  /** Ask; `yes` is the button's label, and `done()` is called when it is pressed. */
  function ask(title, about, yes, done) {
    const dialog = find("ask");
    find("ask-title").textContent = title;
    find("ask-about").textContent = about;
    find("ask-yes").textContent = yes;
    dialog.returnValue = "";
    dialog.showModal();
    find("ask-yes").focus();
    dialog.addEventListener("close", () => dialog.returnValue === "yes" && done(), { once: true });
  }

  return { ask };
})();
