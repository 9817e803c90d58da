/* A file as an array in flash. */
    .section .rodata.blob, "a"
    .balign 64
    .global blob, blob_end
blob:
    .incbin "scene.blob"
blob_end:
    .section .note.GNU-stack, "", %progbits
