# Doxygen's input filter for our headers, which have plain // comments: whole-line comments become ///, and one behind
# a member becomes ///<. Line numbers stay. The first block of a header describes the file.
function escaped(text) {
  # What Doxygen would take for markup: commands, tags, markdown's tables and emphasis.
  gsub(/\\/, "\\\\", text)
  gsub(/@/, "\\@", text)
  gsub(/</, "\\<", text)
  gsub(/>/, "\\>", text)
  gsub(/#/, "\\#", text)
  gsub(/&/, "\\\\&", text)
  gsub(/"/, "\\\"", text)
  gsub(/\|/, "\\|", text)
  gsub(/\*/, "\\*", text)
  gsub(/`/, "'", text)
  gsub(/~/, "\\~", text)
  gsub(/::/, "\\::", text)
  gsub(/--/, "\\--", text)
  return text
}

{
  if (match($0, /^[ \t]*\/\/( |$)/)) {
    indent = substr($0, 1, index($0, "//") - 1)
    text = substr($0, index($0, "//") + 2)
    # "// ---- part of the file ----" and "// namespace" are for readers of the source.
    if (text ~ /^ *---/) { print ""; next }
    if (NR == 1) { print indent "/// \\file"; }
    # An indented line that begins like "1. ", "- " or "name   " is an entry of a list: it stays a line, and so does
    # the first one behind the list.
    is_indented = text ~ /^   +[^ ]/
    is_entry = text ~ /^   +([0-9]+[.)] |- |[^ ]+   )/
    breaks = (is_entry || (was_indented && !is_indented && text != "")) ? " \\n" : ""
    was_indented = is_indented
    print indent "///" breaks escaped(text)
    next
  }
  if (match($0, /[^ \t].*[;,{)][ \t]+\/\/ /) && $0 !~ /^[ \t]*(#|namespace|})/) {
    at = index($0, "// ")
    print substr($0, 1, at - 1) "///<" escaped(substr($0, at + 2))
    next
  }
  was_indented = 0
  print
}
