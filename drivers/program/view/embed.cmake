# Writes OUTPUT, a source file with the text of INPUT as the string NAME. Lines `@INCLUDE file@` become that file, of the same
# folder. A string literal may not be longer than 64 KiB by the standard; g++ and clang++ take any length.
file(READ "${INPUT}" text)
get_filename_component(folder "${INPUT}" DIRECTORY)
string(REGEX MATCHALL "@INCLUDE [a-z_.]+@" includes "${text}")
foreach(include ${includes})
  string(REGEX REPLACE "@INCLUDE ([a-z_.]+)@" "\\1" file "${include}")
  file(READ "${folder}/${file}" included)
  string(REPLACE "${include}\n" "${included}" text "${text}")
endforeach()
string(FIND "${text}" ")epiline\"" clash)
if(NOT clash EQUAL -1)
  message(FATAL_ERROR "${INPUT}: holds the end mark of the string it is written as")
endif()
file(WRITE "${OUTPUT}" "#include \"drivers/program/view/view_page.h\"\n\nnamespace epiline {\n\n"
  "const std::string_view ${NAME} = R\"epiline(${text})epiline\";\n\n}  // namespace epiline\n")
