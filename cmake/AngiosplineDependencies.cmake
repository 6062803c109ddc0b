# The libraries Angiospline links, found the same way by its own build and by its package's users.
find_package(Eigen3 3.4 REQUIRED NO_MODULE)
find_package(tl-expected REQUIRED)
find_package(fmt REQUIRED)
find_package(TBB REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(nanoflann REQUIRED)
find_package(ZLIB REQUIRED)
# Debian keeps the C++ package of NLopt apart from the C one, under the same package name.
find_package(NLopt REQUIRED CONFIG HINTS /usr/lib/${CMAKE_LIBRARY_ARCHITECTURE}/cmake/nlopt_cxx)
find_package(TinyGLTF REQUIRED)

# OpenCASCADE's package file needs this order of components and leaves out its include directory.
find_package(OpenCASCADE REQUIRED COMPONENTS FoundationClasses ModelingData ModelingAlgorithms
  Visualization ApplicationFramework DataExchange)
if(NOT TARGET Angiospline::OpenCASCADE)
  add_library(Angiospline::OpenCASCADE INTERFACE IMPORTED)
  target_include_directories(Angiospline::OpenCASCADE SYSTEM INTERFACE ${OpenCASCADE_INCLUDE_DIR})
  target_link_libraries(Angiospline::OpenCASCADE INTERFACE
    TKSTEP TKXDESTEP TKIGES TKXDEIGES TKXSBase TKXCAF TKLCAF TKCAF TKMesh TKShHealing
    TKTopAlgo TKPrim TKBool TKBO TKFillet TKGeomAlgo TKBRep TKGeomBase TKG3d TKG2d TKMath TKernel)
endif()

# Only the readers and writers that io/images/image_file_itk.cpp names: no filters, no factories.
# Debian packages GDCM's programs apart; ITK's notes on them are of no use here.
set(_angiospline_log_level ${CMAKE_MESSAGE_LOG_LEVEL})
set(CMAKE_MESSAGE_LOG_LEVEL WARNING)
find_package(ITK REQUIRED COMPONENTS ITKCommon ITKIOImageBase ITKIONIFTI ITKIONRRD ITKIOMeta
  ITKIOGDCM ITKIOTIFF ITKIOPNG)
set(CMAKE_MESSAGE_LOG_LEVEL ${_angiospline_log_level})
if(NOT TARGET Angiospline::ITK)
  add_library(Angiospline::ITK INTERFACE IMPORTED)
  target_include_directories(Angiospline::ITK SYSTEM INTERFACE ${ITK_INCLUDE_DIRS})
  target_link_libraries(Angiospline::ITK INTERFACE
    ITKIOImageBase ITKIONIFTI ITKIONRRD ITKIOMeta ITKIOGDCM ITKIOTIFF ITKIOPNG ITKCommon)
endif()

# Only the file formats of VTK: a bare find_package would pull in all of it, windows and Python too.
find_package(VTK 9.1 REQUIRED COMPONENTS CommonCore CommonDataModel IOCore IOXML)
if(NOT TARGET Angiospline::VTK)
  add_library(Angiospline::VTK INTERFACE IMPORTED)
  target_link_libraries(Angiospline::VTK INTERFACE
    VTK::CommonCore VTK::CommonDataModel VTK::IOCore VTK::IOXML)
endif()
