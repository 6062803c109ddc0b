# What is installed beside the program and the libraries, and the two Debian packages made of it by `make deb`:
# angiospline (program, man page, completions, docs) and libangiospline-dev (headers, libraries, CMake package).
set(doc ${CMAKE_INSTALL_DATADIR}/doc/angiospline)
install(FILES cli/man/angiospline.1 DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT program)
install(FILES cli/completions/angiospline.bash RENAME angiospline
  DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions COMPONENT program)
# Where zsh looks depends on the prefix, which is known only when it is installed (Debian's policy).
install(CODE "
  set(folder site-functions)
  if(CMAKE_INSTALL_PREFIX STREQUAL \"/usr\")
    set(folder vendor-completions)
  endif()
  file(INSTALL \"${PROJECT_SOURCE_DIR}/cli/completions/_angiospline\"
    DESTINATION \"\${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_DATADIR}/zsh/\${folder}\")"
  COMPONENT program)
install(FILES README.md CHANGELOG.md DESTINATION ${doc} COMPONENT program)
install(DIRECTORY docs DESTINATION ${doc} COMPONENT program)
install(DIRECTORY samples DESTINATION ${doc} COMPONENT program)

file(WRITE ${PROJECT_BINARY_DIR}/copyright
"Format: https://www.debian.org/doc/packaging-manuals/copyright-format/1.0/
Upstream-Name: Angiospline

Files: *
Copyright: Angiospline developers
License: Apache-2.0
 On Debian systems the whole text is in /usr/share/common-licenses/Apache-2.0.
")
install(FILES ${PROJECT_BINARY_DIR}/copyright DESTINATION ${doc} COMPONENT program)
install(FILES ${PROJECT_BINARY_DIR}/copyright
  DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/libangiospline-dev COMPONENT dev)

# The static libraries need what they are built from: the one list of packages has it.
file(STRINGS scripts/packages.txt packages)
set(dev_depends "")
set(section "")
foreach(line IN LISTS packages)
  if(line MATCHES "^#")
    set(section ${line})
  elseif(section STREQUAL "# libraries" AND line)
    list(APPEND dev_depends ${line})
  endif()
endforeach()
list(JOIN dev_depends ", " dev_depends)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME angiospline)
set(CPACK_PACKAGE_VENDOR "Angiospline developers")
set(CPACK_PACKAGE_CONTACT "Angiospline developers")
set(CPACK_PACKAGE_DIRECTORY ${PROJECT_BINARY_DIR}/packages)
set(CPACK_RESOURCE_FILE_LICENSE ${PROJECT_SOURCE_DIR}/LICENSE)
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_ALL program dev)
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME angiospline)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SHLIBDEPS ON)
set(CPACK_COMPONENT_PROGRAM_DESCRIPTION "Turns angiography volumes or centerlines of blood vessels into closed,
tangent-plane continuous NURBS solids (STEP, IGES, BREP), meshes and reports.")
set(CPACK_DEBIAN_DEV_PACKAGE_NAME libangiospline-dev)
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEV_PACKAGE_DEPENDS "${dev_depends}")
set(CPACK_COMPONENT_DEV_DESCRIPTION "Headers, static libraries and the CMake package: what a C++ program needs to
build, measure and write models by itself.")
include(CPack)
