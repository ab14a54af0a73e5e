# cmake -DNPM= -DSOURCE= -DFILES= -DWORK= -DPAGE= -P build_page.cmake: copies the sources to WORK, installs what the lock file names
# (only when it has changed) and builds into PAGE. Errors in our sources fail; a registry that cannot be reached is a warning.
file(REMOVE_RECURSE ${WORK}/src ${WORK}/test ${WORK}/public)
foreach(file ${FILES})
  get_filename_component(folder ${file} DIRECTORY)
  file(COPY ${SOURCE}/${file} DESTINATION ${WORK}/${folder})
endforeach()

file(SHA256 ${WORK}/package-lock.json wanted)
set(installed "")
if(EXISTS ${WORK}/node_modules/.railfix)
  file(READ ${WORK}/node_modules/.railfix installed)
endif()
if(NOT installed STREQUAL wanted)
  execute_process(COMMAND ${NPM} ci --ignore-scripts --no-audit --no-fund WORKING_DIRECTORY ${WORK} RESULT_VARIABLE failed
                  OUTPUT_FILE ${WORK}/npm.log ERROR_FILE ${WORK}/npm.log)
  file(READ ${WORK}/npm.log said)
  if(failed AND said MATCHES "EUSAGE|EINTEGRITY")
    message(FATAL_ERROR "package-lock.json does not fit package.json or the packages that the registry has, see ${WORK}/npm.log")
  elseif(failed)
    message(WARNING "The monitor's page is not built, because npm could not install what it needs (${WORK}/npm.log). "
                    "Everything else is. Build again when the npm registry can be reached.")
    return()
  endif()
  file(WRITE ${WORK}/node_modules/.railfix ${wanted})
endif()

execute_process(COMMAND ${NPM} run build -- --outDir ${PAGE} --emptyOutDir WORKING_DIRECTORY ${WORK} RESULT_VARIABLE failed
                OUTPUT_VARIABLE said ERROR_VARIABLE said)
if(failed)
  message(FATAL_ERROR "${said}")
endif()
