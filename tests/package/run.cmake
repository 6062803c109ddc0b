# Installs the build to a fresh prefix, then configures, builds and runs the client against it.
file(REMOVE_RECURSE ${WORK})
execute_process(COMMAND ${CMAKE_COMMAND} --install ${BINARY_DIR} --prefix ${WORK}/prefix
  COMMAND_ERROR_IS_FATAL ANY OUTPUT_QUIET)
execute_process(COMMAND ${CMAKE_COMMAND} -G Ninja -S ${CLIENT} -B ${WORK}/build
  -DCMAKE_PREFIX_PATH=${WORK}/prefix -DCMAKE_BUILD_TYPE=Release
  -DCMAKE_CXX_COMPILER=${COMPILER} "-DCMAKE_CXX_FLAGS=${FLAGS}"
  COMMAND_ERROR_IS_FATAL ANY OUTPUT_QUIET)
execute_process(COMMAND ${CMAKE_COMMAND} --build ${WORK}/build COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${WORK}/build/client COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${WORK}/build/tutorial WORKING_DIRECTORY ${WORK} COMMAND_ERROR_IS_FATAL ANY)
file(COPY_FILE ${SAMPLE} ${WORK}/tree.swc)
execute_process(COMMAND ${WORK}/build/readme WORKING_DIRECTORY ${WORK} COMMAND_ERROR_IS_FATAL ANY)
foreach(file fork.step fork.glb tree.step tree.glb)
  if(NOT EXISTS ${WORK}/${file})
    message(FATAL_ERROR "the client has not written ${file}")
  endif()
endforeach()
execute_process(COMMAND ${WORK}/prefix/bin/angiospline --version COMMAND_ERROR_IS_FATAL ANY)
