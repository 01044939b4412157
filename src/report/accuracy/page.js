"use strict";
const left = document.getElementById("left"), right = document.getElementById("right");
const under = document.getElementById("under"), over = document.getElementById("over");
const slider = document.getElementById("slider"), bar = document.getElementById("bar");
const show = () => {
  over.src = document.getElementById(left.value).src;
  under.src = document.getElementById(right.value).src;
};
const cut = () => {
  over.style.clipPath = `inset(0 ${100 - slider.value}% 0 0)`;
  bar.style.left = slider.value + "%";
};
left.addEventListener("change", show);
right.addEventListener("change", show);
slider.addEventListener("input", cut);
show();
cut();
