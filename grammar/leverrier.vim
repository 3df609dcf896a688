" Highlighting of Leverrier specs (*.ham).
" Put this file into ~/.vim/syntax and `au BufRead,BufNewFile *.ham setf leverrier` into your vimrc.
if exists("b:current_syntax")
  finish
endif

syn keyword leverrierStatement system coordinates momenta velocities time input hidden state data constant let param force sensor measure body effect candidates constrain hold linear spline band_limited wrapped
syn keyword leverrierWord for in where and alike span sum terms of per run every pairs
syn keyword leverrierFamily poly tensor pairs trig
syn keyword leverrierFunction sin cos tan asin acos atan sinh cosh tanh exp log sqrt abs sign asinh arcsin arccos arctan ln sgn signum arsinh atan2 rate delayed
syn keyword leverrierConstant pi
syn match leverrierEnergy "\<[TVHL]\>\ze\s*+\?="
syn match leverrierNumber "\<\d\+\(\.\d\+\)\?\([eE][+-]\?\d\+\)\?"
syn match leverrierUnit "\s\[[^].]*\]"
syn match leverrierOperator "+=\|<=\|>=\|==\|!=\|\.\.\|[-+*/^=<>]"
syn region leverrierString start=+"+ end=+"+ oneline
syn match leverrierComment "#.*$"

hi def link leverrierStatement Statement
hi def link leverrierWord Keyword
hi def link leverrierFamily Type
hi def link leverrierFunction Function
hi def link leverrierConstant Constant
hi def link leverrierEnergy Identifier
hi def link leverrierNumber Number
hi def link leverrierUnit Special
hi def link leverrierOperator Operator
hi def link leverrierString String
hi def link leverrierComment Comment

let b:current_syntax = "leverrier"
