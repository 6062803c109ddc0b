# Makes the Debian packages, unpacks both and looks for what each promises; the unpacked program seeds a sample.
file(REMOVE_RECURSE ${WORK})
file(MAKE_DIRECTORY ${WORK})

function(run)
  execute_process(COMMAND ${ARGN} WORKING_DIRECTORY ${WORK} RESULT_VARIABLE failed OUTPUT_VARIABLE said
    ERROR_VARIABLE complaint)
  if(failed)
    message(FATAL_ERROR "${ARGN}\n${failed}\n${said}\n${complaint}")
  endif()
  set(said "${said}" PARENT_SCOPE)
endfunction()

run(${CPACK} -G DEB --config ${BINARY_DIR}/CPackConfig.cmake -B ${WORK})
file(GLOB packages ${WORK}/*.deb)
list(LENGTH packages number)
if(NOT number EQUAL 2)
  message(FATAL_ERROR "two packages are wanted: ${packages}")
endif()
foreach(package IN LISTS packages)
  run(${DPKG_DEB} -x ${package} ${WORK}/root)
  run(${DPKG_DEB} -f ${package} Package)
  string(STRIP "${said}" name)
  run(${DPKG_DEB} -f ${package} Depends)
  set(depends_${name} "${said}")
endforeach()

# Libraries are found from the program itself, development packages from the one list of packages.
foreach(wanted "angiospline;libocct-data-exchange-7.6" "angiospline;libc6" "libangiospline-dev;libeigen3-dev")
  list(GET wanted 0 name)
  list(GET wanted 1 dependency)
  if(NOT depends_${name} MATCHES "${dependency}")
    message(FATAL_ERROR "${name} does not depend on ${dependency}: ${depends_${name}}")
  endif()
endforeach()
foreach(path bin/angiospline share/man/man1/angiospline.1 share/bash-completion/completions/angiospline
    share/zsh/vendor-completions/_angiospline share/doc/angiospline/copyright
    share/doc/angiospline/docs/troubleshooting.md share/doc/angiospline/docs/schemas/model.schema.json
    share/doc/libangiospline-dev/copyright include/angiospline/base/warning.h)
  if(NOT EXISTS ${WORK}/root/usr/${path})
    message(FATAL_ERROR "/usr/${path} is in neither package")
  endif()
endforeach()
run(${WORK}/root/usr/bin/angiospline seed ${WORK}/root/usr/share/doc/angiospline/samples/figure_7_18.swc
  -o ${WORK}/tree.step)
file(REMOVE_RECURSE ${WORK})
