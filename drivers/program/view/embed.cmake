# Writes OUTPUT, a source file with the text of INPUT as the string kViewPage. A string literal may not be longer than
# 64 KiB by the standard; g++ and clang++ take any length.
file(READ "${INPUT}" text)
string(FIND "${text}" ")epiline\"" clash)
if(NOT clash EQUAL -1)
  message(FATAL_ERROR "${INPUT}: holds the end mark of the string it is written as")
endif()
file(WRITE "${OUTPUT}" "#include \"drivers/program/view/view_page.h\"\n\nnamespace epiline {\n\n"
  "const std::string_view kViewPage = R\"epiline(${text})epiline\";\n\n}  // namespace epiline\n")
